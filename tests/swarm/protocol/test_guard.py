"""Offenders are counted, shut out when they do not stop, and let in again."""

import logging

import pytest

from swarm.errors import PayloadError
from swarm.protocol.guard import OFFENCES, SHUT_OUT, WINDOW, Guard


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


def test_causes_are_counted_and_each_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    guard = Guard()
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            guard.reject("a", PayloadError("length", "too short"))
            guard.reject("a", PayloadError("finite", "not finite"))
        guard.reject("b", PayloadError("length", "too short"))
    assert guard.counts == {"length": 4, "finite": 3}
    assert len(caplog.messages) == 3


def test_who_does_not_stop_is_shut_out_for_a_while() -> None:
    clock = Clock()
    guard = Guard(clock)
    for _ in range(OFFENCES):
        assert guard.admits("a")
        guard.reject("a", PayloadError("header", "junk"))
    assert not guard.admits("a")
    assert guard.admits("b")
    assert guard.quarantined() == ("a",)
    assert guard.counts == {"header": OFFENCES, "quarantined": 1}
    clock.now += SHUT_OUT
    assert guard.admits("a")
    assert guard.quarantined() == ()


def test_a_mistake_now_and_then_is_forgiven() -> None:
    clock = Clock()
    guard = Guard(clock)
    for _ in range(5 * OFFENCES):
        guard.reject("a", PayloadError("round", "old"))
        clock.now += WINDOW / (OFFENCES - 2)
    assert guard.admits("a")
