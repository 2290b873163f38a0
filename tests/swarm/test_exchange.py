"""Whom to wait for and how long, what to keep, who is here: decisions without a network."""

import numpy as np
import pytest

from swarm.protocol.timing import (
    PATIENCE,
    Timing,
    awaited,
    deadline,
    elsewhere,
    out_of_time,
    strangers,
)
from swarm.wire.inbox import KEPT, Box, Inbox
from swarm.wire.payload import PROTOCOL, Message, ParameterHeader
from swarm.wire.roster import Presence


def header(agent: str, round_: int, *neighbours: str, incarnation: str = "1") -> ParameterHeader:
    return ParameterHeader(
        version=PROTOCOL,
        fingerprint="",
        agent=agent,
        incarnation=incarnation,
        round=round_,
        neighbours=neighbours,
    )


def message(round_: int, incarnation: str = "1") -> Message:
    return Message(header("b", round_, incarnation=incarnation), np.full(2, float(round_)))


def test_wait_for_a_neighbour_that_is_here_and_has_not_answered() -> None:
    assert awaited(5, ["b", "c"], {"b": 4, "c": 5}, {"b", "c"}, set()) == {"b"}
    assert awaited(5, ["b"], {}, {"b"}, set()) == {"b"}


def test_do_not_wait_for_the_gone_the_late_and_those_ahead() -> None:
    assert awaited(5, ["b"], {"b": 4}, set(), set()) == set()
    assert awaited(5, ["b"], {"b": 4}, {"b"}, {"b"}) == set()
    assert awaited(5, ["b"], {"b": 6}, {"b"}, set()) == set()


def test_do_not_wait_for_those_who_exchange_with_others() -> None:
    """Somebody has just come, or gone, and not everybody knows."""
    views = [header("b", 5, "c"), header("c", 5, "a"), header("d", 4, "b")]
    assert elsewhere("a", 5, ["b", "c", "d"], views) == {"b"}  # d may yet count us in round 5


def test_tell_those_who_wait_in_vain() -> None:
    views = [header("b", 5, "a"), header("c", 5, "a"), header("d", 6, "a"), header("e", 5, "b")]
    assert [view.agent for view in strangers("a", 5, ["b"], views)] == ["c"]
    assert [view.agent for view in strangers("a", 6, ["b"], views)] == ["c", "d"]


def test_the_deadline_follows_the_rounds_within_floor_and_ceiling() -> None:
    timing = Timing(round=30.0, round_floor=2.0)
    assert deadline([], timing) == 30.0
    assert deadline([0.004] * 20, timing) == 2.0
    assert deadline([1.5] * 20, timing) == pytest.approx(PATIENCE * 1.5)
    assert deadline([1.0] * 19 + [25.0], timing) == pytest.approx(PATIENCE)
    assert deadline([20.0] * 5, timing) == 30.0


def test_silence_runs_out_of_time_and_signs_of_life_do_not() -> None:
    heard = {"silent": 90.0, "waiting": 101.7}
    waiting = ["silent", "waiting", "never heard"]
    assert out_of_time(waiting, heard, published=100.0, limit=2.0, now=101.9) == set()
    assert out_of_time(waiting, heard, 100.0, 2.0, 102.0) == {"silent", "never heard"}
    assert out_of_time(waiting, heard, 100.0, 2.0, 102.7) == set(waiting)


def test_an_inbox_gives_messages_by_round_and_the_newest() -> None:
    inbox = Inbox()
    before = inbox.count
    inbox.store(message(4))
    inbox.store(message(5))
    assert inbox.count > before
    inbox.wait(before, timeout=60.0)  # returns at once: something has come since
    assert inbox.of_round(4, ["b", "c"])["b"].header.round == 4
    assert inbox.of_round(3, ["b"]) == {}
    assert inbox.newest(["b", "c"])["b"].header.round == 5
    inbox.touch(header("c", 7))
    inbox.touch(header("c", 6, "a"))  # overtaken on its way
    assert {view.agent: view.round for view in inbox.views()} == {"b": 5, "c": 7}
    assert inbox.rounds() == {"b": 5, "c": -1}
    assert inbox.newest(["c"]) == {}
    assert set(inbox.heard()) == {"b", "c"}
    assert {agent: round_ for agent, (round_, _) in inbox.ages().items()} == {"b": 5, "c": -1}


def test_a_box_keeps_the_newest_rounds_and_the_first_message_of_each() -> None:
    box = Box()
    assert box.newest() == -1
    for round_ in range(10):
        box.store(message(round_))
    first = box.messages[9]
    box.store(message(9))
    assert box.messages[9] is first
    assert sorted(box.messages) == list(range(10 - KEPT, 10))
    assert box.newest() == 9


def test_a_new_incarnation_starts_a_new_box() -> None:
    box = Box()
    box.store(message(40))
    box.store(message(7, incarnation="2"))
    assert list(box.messages) == [7]


def test_presence_follows_tokens_in_any_order() -> None:
    presence = Presence()
    presence.put("a", "1")
    presence.put("a", "2")  # restarted before the old token was withdrawn
    assert presence.incarnation("a") == "2"
    presence.delete("a", "1")
    assert presence.incarnation("a") == "2"
    presence.delete("a", "2")
    presence.delete("a", "2")
    assert presence.incarnation("a") is None
    assert not presence.alive
