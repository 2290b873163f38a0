"""What ``swarm status`` calls trouble, and how its facts are told."""

import msgspec
import pytest
from rich.console import Console

from agent.config.experiment import AgentEntry, SwarmFile, Task
from agent.learning.estimators import Exact
from deploy.observe.health import STALE, judge
from deploy.observe.picture import picture
from swarm.reports.telemetry import AgentStatus, NeighbourStatus
from tests.deploy.observe.crowds import answers, crowd

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


def test_json_holds_facts_by_these_names() -> None:
    """Whoever reads ``status --json`` relies on them: a new name is welcome, none may go."""
    told = msgspec.to_builtins(judge(SWARM, {"a": status("a", 7, NeighbourStatus(round=7))}))
    assert set(told) == {
        "swarm", "health", "problems", "consensus_error", "agents", "silent", "result",
    }  # fmt: skip
    assert set(told["agents"]["a"]) == {
        "state", "round", "rounds", "value", "distance", "consensus_error", "disagreement",
        "neighbours", "rejected", "quarantined", "one_sided", "memory_mb", "pid", "incarnation",
    }  # fmt: skip
    assert told["silent"] == ("b",)
    assert told["agents"]["a"]["neighbours"] == {"b": {"round": 7, "age": None, "link": None}}


def lines(size: int, height: int, silent: int = 0) -> list[str]:
    """What 80 columns show of a crowd, of which so many do not answer."""
    config = crowd(size)
    here = answers(config)
    for agent in config.members[3 : 3 + silent]:
        del here[agent]
    here["drone01"] = msgspec.structs.replace(here["drone01"], rejected={"round": 7})
    console = Console(width=80, height=height, highlight=False)
    with console.capture() as capture:
        console.print(picture(config, judge(config, here), height))
    return capture.get().splitlines()


@pytest.mark.parametrize(("size", "height"), [(4, 24), (16, 24), (16, 50), (64, 24), (64, 50)])
@pytest.mark.parametrize("silent", [0, 1])
def test_a_crowd_fits_a_screen_and_who_is_in_trouble_is_seen(
    size: int, height: int, silent: int
) -> None:
    shown = lines(size, height, silent)
    assert len(shown) <= height
    assert max(map(len, shown)) <= 80
    assert not any("…" in line for line in shown)
    text = "\n".join(shown)
    assert ["drone01", "learning", "312/1000"] in [line.split()[:3] for line in shown]
    assert "drone01 rejected messages: round 7" in text
    assert ("no answer from drone03" in text) == bool(silent)


def test_of_many_silent_agents_some_are_named_and_all_counted() -> None:
    shown = lines(64, 24, silent=40)
    assert len(shown) <= 24
    text = " ".join(" ".join(shown).split())
    assert "24 of 64 agents answer" in text
    assert "no answer from drone03, drone04" in text
    assert "drone14 and 28 more" in text
