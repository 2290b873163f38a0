"""What ``swarm status`` calls trouble."""

from agent.config.experiment import AgentEntry, SwarmFile, Task
from agent.learning.estimators import Exact
from deploy.observe.status import STALE, judge
from swarm.reports.telemetry import AgentStatus, NeighbourStatus

SWARM = SwarmFile(
    name="judged",
    estimator=Exact(),
    agents=tuple(AgentEntry(name, Task("sim:GridWorld-v0", {"layout": "a"})) for name in "ab"),
)


def status(agent: str, round_: int, heard: NeighbourStatus) -> AgentStatus:
    """An agent that learns, and what it heard of the other one."""
    (other,) = {"a", "b"} - {agent}
    return AgentStatus(
        agent=agent, incarnation="1", pid=1, state="learning", round=round_, rounds=100,
        neighbours={other: heard},
    )  # fmt: skip


def test_a_long_round_is_no_trouble() -> None:
    old = 60 * STALE
    answers = {
        "a": status("a", 7, NeighbourStatus(round=7, age=old)),
        "b": status("b", 7, NeighbourStatus(round=7, age=old)),
    }
    assert judge(SWARM, answers).health == "healthy"


def test_a_neighbour_that_gets_on_unheard_is() -> None:
    answers = {
        "a": status("a", 7, NeighbourStatus(round=5, age=2 * STALE)),
        "b": status("b", 7, NeighbourStatus(round=7, age=0.1)),
    }
    assert judge(SWARM, answers).problems == ("a last heard b 10.0 s ago",)


def test_so_is_one_that_does_not_answer() -> None:
    answers = {"a": status("a", 7, NeighbourStatus(round=5, age=2 * STALE))}
    assert judge(SWARM, answers).problems == ("b does not answer",)
    assert judge(SWARM, {}).health == "nobody"
