"""The status of a swarm as a person reads it: a line that sums up, a table, and what is wrong.

Where the screen has no room for all agents, those that need looking at come first.
"""

from collections import Counter
from collections.abc import Mapping

from rich import box
from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from agent.config.experiment import SwarmFile
from deploy.observe import crowd
from deploy.observe.health import AgentFacts, SwarmStatus, missed
from swarm.reports.telemetry import NeighbourStatus
from swarm.wire.links import LinkReport

PROBLEMS = 5  # lines about them on a screen
SILENT = 12  # of the agents that do not answer, so many are named
EDGES = 8  # links on a screen, the fullest first
EDGES_CROWD = 2  # and of many agents
BESIDE = 10  # lines of all else: summary, headings, what is left out, weights


def picture(config: SwarmFile, status: SwarmStatus, height: int) -> RenderableType:
    """A status of whoever answers, for a screen of ``height`` lines."""
    if status.health == "nobody":
        endpoints = [config.endpoint(member) for member in config.members]
        return Text(f'nobody of swarm "{config.name}" answers on {crowd.named(endpoints)}')
    many = len(config.members) > crowd.MANY
    links, problems = _links(status.agents, EDGES_CROWD if many else EDGES), _problems(status)
    room = crowd.shown(len(config.members), height, BESIDE + len(links) + len(problems))
    agents, rest = config.members, []
    if room < len(agents):
        here = sorted(status.agents, key=lambda agent: _worth_a_look(agent, status))
        agents = tuple(here[:room])
        states = Counter(status.agents[agent].state for agent in here[room:])
        others = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
        rest = [Text(f"and {others}; all: --json")] if others else []
    return Group(
        *_summary(config, status),
        _table(agents, status, named=not many),
        *rest,
        Text(_weights(status.agents)),
        *(Text(line) for line in links),
        *(Text(problem, style="yellow") for problem in problems),
    )


def _summary(config: SwarmFile, status: SwarmStatus) -> list[Text]:
    """One line, or two where numbers of many agents need summing up."""
    agents = status.agents.values()
    here = f"{len(agents)} of {len(config.members)} agents answer"
    reached = crowd.rounds([agent.round for agent in agents], config.rounds)
    lines = [Text(f"swarm {config.name}: {status.health}, {here}, round {reached}", style="bold")]
    if len(config.members) > crowd.MANY:
        values = [agent.value for agent in agents if agent.value is not None]
        lengths = [agent.distance for agent in agents if agent.distance is not None]
        gains = f"flights [m] {crowd.spread(lengths, '.1f')}"
        if not lengths:
            gains = f"return {crowd.spread(values)}"
        error = status.consensus_error
        lines.append(
            Text(gains + ("" if error is None else f"; consensus error at most {error:.3f}"))
        )
    return lines


def _table(agents: tuple[str, ...], status: SwarmStatus, named: bool) -> Table:
    flights = any(facts.distance is not None for facts in status.agents.values())
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("agent", overflow="fold")
    table.add_column("state", no_wrap=True)
    for heading in ("round", escape("flight [m]") if flights else "return", "consensus\nerror"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("neighbours" if named else "neighbours,\noldest word", overflow="fold")
    table.add_column("MB", justify="right", no_wrap=True)
    for name in agents:
        facts = status.agents.get(name)
        if facts is None:
            table.add_row(name, Text("no answer", style="yellow"))
            continue
        gain = facts.distance if flights else facts.value
        table.add_row(
            name,
            facts.state,
            f"{facts.round}/{facts.rounds}",
            "-" if gain is None else f"{gain:.{1 if flights else 3}f}",
            "-" if facts.consensus_error is None else f"{facts.consensus_error:.3f}",
            _nearby(facts.neighbours, named),
            f"{facts.memory_mb:.0f}",
        )
    return table


def _nearby(neighbours: Mapping[str, NeighbourStatus], named: bool) -> str:
    """Neighbours and how old their last words are, or how many and the oldest of these."""
    if named:
        return ", ".join(f"{name} {_age(heard)}" for name, heard in neighbours.items())
    if not neighbours:
        return "0"
    silent = [name for name, heard in neighbours.items() if heard.age is None]
    if silent:
        return f"{len(neighbours)}, {len(silent)} never"
    return f"{len(neighbours)}, {_age(max(neighbours.values(), key=lambda heard: heard.age or 0))}"


def _links(agents: Mapping[str, AgentFacts], most: int) -> list[str]:
    """Every edge's rate, latency, backlog and age, from either end; the fullest first, no flood."""
    edges = [
        (heard.link.backlog, f"{name} -> {other}: {describe(heard.link)}")
        for name, facts in agents.items()
        for other, heard in facts.neighbours.items()
        if heard.link is not None
    ]
    shown = [line for _, line in sorted(edges, key=lambda edge: -edge[0])[:most]]
    more = len(edges) - len(shown)
    return [*shown, *([f"and {more} more links"] if more else [])]


def describe(link: LinkReport) -> str:
    """A link in words."""
    rate = "shared memory" if link.shared else "rate unknown"
    if link.rate is not None and not link.shared:
        rate = f"{link.rate / 1e6:.3g} Mbit/s"
    latency = "" if link.latency is None else f", {link.latency * 1e3:.3g} ms"
    age = "never" if link.age is None else f"{link.age:.1f} s ago"
    again = f", {link.resent / 1e6:.2f} MB sent again" if link.resent else ""
    lost = f", {link.undelivered} messages not delivered" if link.undelivered else ""
    return f"{rate}{latency}, {link.backlog / 1e6:.2f} MB waiting, moved {age}{again}{lost}"


def _age(heard: NeighbourStatus) -> str:
    if heard.age is None:
        return "never"
    return f"{heard.age * 1e3:.0f} ms" if heard.age < 1 else f"{heard.age:.0f} s"


def _worth_a_look(agent: str, status: SwarmStatus) -> tuple[bool, bool, int, float]:
    """Sorts who is in trouble first, then who does not learn, lags behind, or is far from all."""
    facts = status.agents[agent]
    troubled = bool(facts.rejected or facts.quarantined) or any(
        missed(heard, status.agents.get(name)) for name, heard in facts.neighbours.items()
    )
    learning = facts.state == "learning"
    return (not troubled, learning, facts.round, -(facts.consensus_error or 0.0))


def _problems(status: SwarmStatus) -> list[str]:
    """What is wrong, in few lines."""
    lines = [f"no answer from {crowd.named(status.silent, SILENT)}"] if status.silent else []
    lines += status.problems[len(status.silent) :]  # a line each of the silent came first
    if len(lines) > PROBLEMS:
        lines[PROBLEMS - 1 :] = [f"{len(lines) - PROBLEMS + 1} more problems: --json"]
    return lines


def _weights(agents: Mapping[str, AgentFacts]) -> str:
    """Whether both ends of every edge used the same weight in every round."""
    one_sided = {name: facts.one_sided for name, facts in agents.items() if facts.one_sided}
    if not one_sided:
        return "W was symmetric and doubly stochastic on what was exchanged, in every round"
    counts = crowd.named([f"{name} {count}" for name, count in sorted(one_sided.items())])
    return f"edges that only one end used in a round, so far: {counts}"
