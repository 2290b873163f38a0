"""Offenders are counted, shut out when they do not stop, and let in again."""

import logging
import tracemalloc

import pytest

from swarm.errors import PayloadError
from swarm.protocol.guard import OFFENCES, SAY_AGAIN, SHUT_OUT, STRANGERS, WINDOW, Guard


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


def test_causes_are_counted_and_each_is_said_once_a_minute(
    caplog: pytest.LogCaptureFixture,
) -> None:
    clock = Clock()
    guard = Guard("ab", clock)
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            guard.reject("a", PayloadError("length", "too short"))
            guard.reject("a", PayloadError("finite", "not finite"))
        guard.reject("b", PayloadError("length", "too short"))
        assert len(caplog.messages) == 2
        clock.now += SAY_AGAIN
        guard.reject("b", PayloadError("length", "too short"))
    assert guard.counts == {"length": 5, "finite": 3}
    assert "b (too short; 5 so far" in caplog.messages[-1]


def test_a_hundred_thousand_names_cost_nothing_and_are_shut_out_together(
    caplog: pytest.LogCaptureFixture,
) -> None:
    guard = Guard(("a",), Clock())
    tracemalloc.start()
    with caplog.at_level(logging.WARNING):
        for i in range(100_000):
            name = f"mallory{i:040d}"
            if guard.admits(name):
                guard.reject(name, PayloadError("stranger", f'"{name}" is no member'))
    used, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert used < 1e6
    assert len(caplog.messages) == 2  # the first offence, and that strangers are shut out
    assert guard.counts == {"stranger": OFFENCES, "quarantined": 100_000 - OFFENCES}
    assert guard.quarantined() == (STRANGERS,)
    assert guard.admits("a")


def test_who_does_not_stop_is_shut_out_for_a_while() -> None:
    clock = Clock()
    guard = Guard("ab", clock)
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
    guard = Guard("ab", clock)
    for _ in range(5 * OFFENCES):
        guard.reject("a", PayloadError("round", "old"))
        clock.now += WINDOW / (OFFENCES - 2)
    assert guard.admits("a")
