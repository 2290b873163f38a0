"""What takes long in the worlds is announced; what is quick is not, and errors look different."""

import logging
import threading
import time

import pytest

from sim import notices
from sim.notices import Work, during, shown_elsewhere, under_way


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody listens to the log, not even pytest."""
    monkeypatch.setattr(notices.log, "hasHandlers", lambda: False)


def told(monkeypatch: pytest.MonkeyPatch, quiet: float = 0.0) -> threading.Event:
    """Announcements come after `quiet` seconds; the event says that the first has."""
    monkeypatch.setattr(notices, "QUIET", quiet)
    event, tell = threading.Event(), Work._tell

    def telling(work: Work) -> None:
        tell(work)
        event.set()

    monkeypatch.setattr(Work, "_tell", telling)
    return event


def test_long_work_is_announced_in_a_line_of_its_own_form(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = told(monkeypatch)
    with during("baking"):
        assert said.wait(30)
    assert capsys.readouterr() == ("", "... baking\n")


def test_quick_work_is_not(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = told(monkeypatch, quiet=3600.0)
    with during("baking"):
        assert under_way() == "baking"
    assert under_way() == "" and not said.is_set()
    assert capsys.readouterr().err == ""


def test_many_short_stretches_are_told_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said, clock = told(monkeypatch, quiet=3600.0), [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    work = Work("compiling")
    for _ in range(2):
        work.begin()
        clock[0] += 1800.0
        work.end()
    assert not said.is_set()
    for _ in range(2):  # what is left of the quiet is nothing
        work.begin()
        assert said.wait(30)
        work.end()
    assert capsys.readouterr().err == "... compiling\n"


def test_the_innermost_work_is_under_way() -> None:
    with during("building"):
        with during("baking"):
            assert under_way() == "baking"
        assert under_way() == "building"


def test_nothing_is_printed_by_who_shows_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = told(monkeypatch)
    with shown_elsewhere(), during("baking"):
        assert said.wait(30)
    assert capsys.readouterr().err == ""


def test_who_logs_finds_it_in_the_log(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(notices.log, "hasHandlers", lambda: True)
    said = told(monkeypatch)
    with caplog.at_level(logging.INFO), during("baking"):
        assert said.wait(30)
    assert caplog.messages == ["baking"]
    assert capsys.readouterr().err == ""
