"""A line a minute in an agent's log."""

import logging
import threading

import pytest

from agent.daemon.logbook import line_of, logbook_kept
from swarm.reports.telemetry import AgentStatus, NeighbourStatus

STATUS = AgentStatus(
    agent="drone0", incarnation="1f", pid=7, state="learning", round=3, rounds=9, distance=12.5,
    neighbours={"drone1": NeighbourStatus(round=3, age=0.25), "drone3": NeighbourStatus()},
)  # fmt: skip


def test_a_line_tells_how_far_it_is_and_whom_it_heard() -> None:
    assert line_of(STATUS, 0.0) == (
        "round 3 of 9: learning, flights 12.5 m, heard drone1 0.2 s ago, drone3 never"
    )
    assert "in this round for 75 s" in line_of(STATUS, 75.0)


def test_lines_come_until_the_end(caplog: pytest.LogCaptureFixture) -> None:
    asked = threading.Semaphore(0)

    def ask() -> AgentStatus:
        asked.release()
        return STATUS

    with caplog.at_level(logging.INFO), logbook_kept(ask, every=0.001):
        for _ in range(3):
            assert asked.acquire(timeout=60.0)
    assert sum("round 3 of 9: learning" in line for line in caplog.messages) >= 2
    assert not any(thread.name == "logbook" for thread in threading.enumerate())
