"""The memory is bounded, covers the whole run, and answers who asks; bad answers are dropped."""

from collections.abc import Callable
from itertools import pairwise

import msgspec
import pytest
import zenoh

from swarm.reports.history import LIMIT, History, ask_history, serve_history
from swarm.reports.telemetry import RoundReport
from swarm.wire.keys import Keys

KEYS = Keys("test")


def report(round_: int, agent: str = "drone0") -> RoundReport:
    return RoundReport(
        agent=agent, round=round_, time=0.0, seconds=0.1, waited=0.0, value=0.0, episodes=0,
        steps=0, gradient_norm=0.0, disagreement=0.0, weights={},
    )  # fmt: skip


def remembered(history: History) -> list[int]:
    return [kept.round for kept in history.reports()]


def test_a_short_run_is_remembered_whole() -> None:
    history = History(limit=8)
    for round_ in range(8):
        history.take(report(round_))
    assert remembered(history) == list(range(8))


@pytest.mark.parametrize("rounds", [9, 17, 1000])
def test_a_long_run_is_remembered_evenly_from_its_beginning(rounds: int) -> None:
    history = History(limit=8)
    for round_ in range(rounds):
        history.take(report(round_))
    kept = remembered(history)
    assert kept[0] == 0
    assert len(kept) <= 8
    assert len({b - a for a, b in pairwise(kept)}) == 1
    assert rounds - kept[-1] <= kept[1]


def test_agents_that_joined_at_different_times_remember_the_same_rounds() -> None:
    early, late = History(limit=8), History(limit=8)
    for round_ in range(100):
        early.take(report(round_))
        if round_ >= 50:
            late.take(report(round_))
    assert set(remembered(early)[-3:]) <= set(remembered(late))


def test_rounds_played_again_replace_what_was() -> None:
    history = History(limit=8)
    for round_ in (0, 1, 2, 3, 2):
        history.take(report(round_))
    assert remembered(history) == [0, 1, 2]


def says(name: str, body: bytes) -> Callable[[zenoh.Query], None]:
    return lambda query: query.reply(KEYS.history(name), body)


def test_who_asks_is_answered_and_lies_are_dropped() -> None:
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    history = History()
    history.take(report(0))
    lies = {
        "torn": msgspec.msgpack.encode([report(0, "torn")])[:-1],
        "foreign": msgspec.msgpack.encode([report(0, "drone0")]),
        "long": msgspec.msgpack.encode([report(i, "long") for i in range(LIMIT + 1)]),
    }
    with zenoh.open(config) as session:
        serve_history(session, KEYS, "drone0", history)
        for name, body in lies.items():
            session.declare_queryable(KEYS.history(name), says(name, body))
        assert ask_history(session, KEYS, 2.0) == {"drone0": [report(0)]}
