"""What a fault cost, worked out by hand on a swarm of three."""

import msgspec
import pytest

from deploy.chaos.faults import Fault
from deploy.launch.journal import Event, Kind
from deploy.reproduce.aftermath import (
    Trace,
    agreement,
    disagreement,
    examine,
    linked,
    one_sided,
    repeated,
    usual_disagreement,
)
from swarm.reports.telemetry import RoundReport

NEAR = {"a": frozenset("bc"), "b": frozenset("ac"), "c": frozenset("ab")}
BLANK = RoundReport(
    agent="", round=0, time=0.0, seconds=0.1, waited=0.0, value=0.0, episodes=0, steps=0,
    gradient_norm=0.0, disagreement=0.2, weights={},
)  # fmt: skip


def played(agent: str, rounds: range, seconds: float = 0.1, **changes: object) -> list[RoundReport]:
    """Rounds one after the other, round r over at ``(r + 1) * seconds`` [s]."""
    whole = dict.fromkeys(NEAR[agent], 0.25)
    return [
        msgspec.structs.replace(
            BLANK, **{"agent": agent, "round": r, "time": (r + 1) * seconds, "seconds": seconds,
                      "weights": whole, **changes},
        )
        for r in rounds
    ]  # fmt: skip


def trace(*faults: Fault, events: tuple[Event, ...] = (), **reports: list[RoundReport]) -> Trace:
    calm = {agent: played(agent, range(20)) for agent in NEAR}
    return Trace(NEAR, calm | reports, faults, events)


def test_a_calm_run_costs_nothing() -> None:
    found = examine(trace(), first=5, tolerated=0.24)
    assert (found.longest, found.following, found.slow) == (0.1, 0.1, 0)
    assert (found.absence, found.reunion, found.reconnect) == (0, None, None)
    assert (found.restarts, found.repeated, found.one_sided) == (0, 0, 0)


def test_a_frozen_neighbour_costs_the_others_one_round_and_its_own_does_not_count() -> None:
    fault = Fault(kind="freeze", agents=("c",))
    events = (Event(1.05, "fault", "freeze c"), Event(3.55, "fault", "end of freeze c"))
    alone = {
        agent: [
            *played(agent, range(10)),
            *played(agent, range(10, 11), seconds=2.2, time=3.2, weights={other: 0.5}),
            *played(agent, range(11, 15), weights={other: 0.5}, time=3.5),
            *played(agent, range(15, 20), time=4.0),
        ]
        for agent, other in [("a", "b"), ("b", "a")]
    }
    frozen = [
        *played("c", range(10)),
        *played("c", range(10, 11), seconds=2.6, time=3.6),
        *played("c", range(15, 20), time=4.0),
    ]
    found = examine(trace(fault, events=events, **alone, c=frozen), first=5, tolerated=0.24)
    assert (found.longest, found.following, found.slow) == (2.2, 0.1, 1)
    assert found.absence == 1  # round 14 was the last alone
    assert found.repeated == 0


def test_the_parts_of_a_swarm_agree_some_rounds_after_they_meet() -> None:
    fault = Fault(kind="partition", agents=("a",))
    events = (Event(0.55, "fault", "partition a"), Event(1.25, "fault", "end of partition a"))
    reports = {
        agent: [
            *played(agent, range(5)),
            *played(agent, range(5, 13), weights={}),
            *played(agent, range(13, 16), disagreement=3.0),
            *played(agent, range(16, 18), disagreement=0.23, weights={other: 0.5}),
            *played(agent, range(18, 20), disagreement=0.23),
        ]
        for agent, other in [("a", "b"), ("b", "c"), ("c", "b")]
    }
    found = examine(trace(fault, events=events, **reports), first=0, tolerated=0.24)
    assert found.absence == 18 - 11  # round 11 was over when the cut was mended
    assert found.reunion == 16 - 13  # over b alone
    assert found.reconnect == pytest.approx(1.4 - 1.25)


def test_who_never_agrees_again_is_told_so() -> None:
    fault = Fault(kind="partition", agents=("a",))
    events = (Event(0.55, "fault", "partition a"), Event(1.25, "fault", "end of partition a"))
    reports = {"a": [*played("a", range(5)), *played("a", range(5, 20), weights={})]}
    cut = {
        agent: [*played(agent, range(5)), *played(agent, range(5, 20), weights={other: 0.5})]
        for agent, other in [("b", "c"), ("c", "b")]
    }
    found = examine(trace(fault, events=events, **reports, **cut), first=0, tolerated=0.24)
    assert (found.absence, found.reunion, found.reconnect) == (None, None, None)


def test_a_wrong_clock_does_not_move_the_fault() -> None:
    fault = Fault(kind="clock", agents=("c",))
    events = (Event(1.05, "fault", "clock c by -9 s"),)
    late = [*played("c", range(10)), *played("c", range(10, 20), time=-7.0)]
    late[15] = msgspec.structs.replace(late[15], seconds=0.7)
    found = examine(trace(fault, events=events, c=late), first=5, tolerated=0.24)
    assert (found.longest, found.slow) == (0.7, 1)


def test_the_absence_of_one_who_was_killed_begins_when_the_others_notice() -> None:
    events = (Event(1.05, "fault", "kill c"),)
    alone = {
        agent: [
            *played(agent, range(12)),
            *played(agent, range(12, 15), weights={other: 0.5}),
            *played(agent, range(15, 20)),
        ]
        for agent, other in [("a", "b"), ("b", "a")]
    }
    reports = {"c": [*played("c", range(12)), *played("c", range(15, 20))]}
    fault = Fault(kind="kill", agents=("c",))
    found = examine(trace(fault, events=events, **alone, **reports), first=5, tolerated=0.24)
    assert found.absence == 15 - 9  # round 9 was over when it died


def test_restarts_are_read_from_the_journal() -> None:
    happened: tuple[Kind, ...] = ("fault", "ended", "restarted")
    events = tuple(Event(1.05, kind, "whatever the user read", ("c",)) for kind in happened)
    fault = Fault(kind="kill", agents=("c",))
    assert examine(trace(fault, events=events), first=5, tolerated=0.24).restarts == 1


def test_disagreement_counts_where_the_swarm_is_whole() -> None:
    reports = played("a", range(5)) + played("a", range(5, 20), disagreement=0.5)
    reports[7] = msgspec.structs.replace(reports[7], weights={"b": 0.5})
    found = disagreement(trace(a=reports))
    assert 7 not in found
    assert (found[4], found[5]) == (0.2, 0.5)
    assert usual_disagreement(trace(a=reports), first=5) == 0.5
    assert agreement(found, since=2, tolerated=0.3) == 2
    assert agreement(found, since=5, tolerated=0.3) is None


def test_a_swarm_is_linked_while_somebody_passes_everything_on() -> None:
    a, c = (played(x, range(5), weights={"b": 0.5}, disagreement=0.7) for x in "ac")
    assert disagreement(trace(a=a, c=c)) == {}
    assert disagreement(trace(a=a, c=c), linked)[4] == 0.7
    a, b = played("a", range(5), weights={}), played("b", range(5), weights={"c": 0.5})
    assert disagreement(trace(a=a, b=b, c=c), linked) == {}


def test_a_round_played_twice_and_an_edge_used_by_one_end_are_counted() -> None:
    twice = [*played("a", range(5)), *played("a", range(4, 8)), *played("a", range(7, 9))]
    assert repeated({"a": twice}) == 2
    assert repeated({"a": played("a", range(9))}) == 0
    reports = {agent: played(agent, range(3)) for agent in NEAR}
    assert one_sided(reports) == 0
    reports["a"][1] = msgspec.structs.replace(reports["a"][1], weights={"b": 0.25})
    assert one_sided(reports) == 1  # c used a, and a did not use c
    del reports["c"][1]
    assert one_sided(reports) == 0  # c did not tell
