"""Swarms of many agents, and what they answer; nothing runs."""

from agent.config.experiment import AgentEntry, SwarmFile, Task
from agent.learning.estimators import Exact
from swarm.mixing.weights import neighbours
from swarm.reports.telemetry import AgentStatus, NeighbourStatus, RoundReport
from swarm.wire.links import LinkReport

ROUNDS = 1000
LINK = LinkReport(rate=17_300.0, latency=0.00946, age=4.5)


def crowd(size: int) -> SwarmFile:
    """A ring of so many agents with two tasks."""
    tasks = [Task("sim:Chain-v0", {"task": task}) for task in (1, 2)]
    agents = tuple(AgentEntry(f"drone{i:02d}", tasks[i % 2]) for i in range(size))
    return SwarmFile(name="crowd", estimator=Exact(), agents=agents, rounds=ROUNDS)


def answers(config: SwarmFile, round_: int = 312) -> dict[str, AgentStatus]:
    """All of them well."""
    return {
        agent: AgentStatus(
            agent=agent, incarnation="1", pid=1, state="learning", round=round_, rounds=ROUNDS,
            neighbours={
                other: NeighbourStatus(round=round_, age=0.012, link=LINK)
                for other in neighbours(config.topology, config.members, agent)
            },
            value=0.01 * place, sketch=(0.1 * place, 0.0), memory_mb=61.0,
        )
        for place, agent in enumerate(config.members)
    }  # fmt: skip


def reports(config: SwarmFile, metres: bool = False) -> list[RoundReport]:
    """A report of each; the last agent is behind and missed a neighbour."""
    last = config.members[-1]
    return [
        RoundReport(
            agent=agent, round=300 if agent == last else 312, time=1.0, seconds=0.05, waited=0.0,
            value=0.01 * place, episodes=1, steps=1, gradient_norm=1.0, disagreement=0.5,
            weights={config.members[0]: 0.25},
            missing=(config.members[1],) if agent == last else (),
            sketch=(0.1 * place,), distance=10.0 + place if metres else None,
        )
        for place, agent in enumerate(config.members)
    ]  # fmt: skip
