"""Whom to wait for, what to keep, who is here: the exchange's decisions without a network."""

import numpy as np

from swarm.exchange import KEPT, Box, awaited
from swarm.payload import PROTOCOL, Message, ParameterHeader
from swarm.roster import Presence


def message(round_: int, incarnation: str = "1") -> Message:
    header = ParameterHeader(
        version=PROTOCOL,
        fingerprint="",
        agent="b",
        incarnation=incarnation,
        round=round_,
        neighbours=(),
    )
    return Message(header, np.full(2, float(round_)))


def test_wait_for_a_neighbour_that_is_here_and_has_not_answered() -> None:
    assert awaited(5, ["b", "c"], {"b": [3, 4], "c": [4, 5]}, {"b", "c"}, set()) == {"b"}
    assert awaited(5, ["b"], {}, {"b"}, set()) == {"b"}


def test_do_not_wait_for_the_gone_the_late_and_those_ahead() -> None:
    assert awaited(5, ["b"], {"b": [4]}, set(), set()) == set()
    assert awaited(5, ["b"], {"b": [4]}, {"b"}, {"b"}) == set()
    assert awaited(5, ["b"], {"b": [4, 6]}, {"b"}, set()) == set()


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
