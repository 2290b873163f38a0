"""After two seconds a person reads what goes on, for how long, and how far."""

import io
import time

import pytest
from rich.console import Console

from deploy.process import news
from deploy.process.news import News, lasting, working
from sim.notices import QUIET, during


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    return now


def lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    out, err = capsys.readouterr()
    assert out == ""
    return err.splitlines()


def test_nothing_before_two_seconds(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    told = News("flying")
    told.tick(QUIET - 0.1)
    assert lines(capsys) == []


def test_a_pipe_gets_what_for_how_long_and_how_far(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    told = News("flying")
    told.tick(2.0)
    told.say("indoor-long", 0.25)
    clock[0] = 2.0
    told.tick(11.0)
    told.tick(30.0)
    assert lines(capsys) == [
        "... flying, 2 s",
        "... flying: indoor-long, 30 s, 25%, about 90 s left",
    ]


def test_lines_in_a_pipe_become_rare(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    told = News("flying")
    for second in range(3600):
        clock[0] = float(second)
        told.tick(clock[0])
    assert 60 <= len(lines(capsys)) <= 64


def test_a_line_that_stays_is_news(clock: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    told = News("flying")
    clock[0] = 1.9
    told.line("[in the air]")
    told.tick(3.8)
    assert lines(capsys) == ["[in the air]"]


def test_what_the_worlds_announce_is_shown(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    told = News("flying")
    told.say("indoor-long")
    with during("baking the light"):
        told.tick(2.0)
    assert lines(capsys) == ["... flying: indoor-long, baking the light, 2 s"]


def test_a_terminal_has_one_line_and_keeps_none(
    clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = io.StringIO()

    def terminal(**settings: object) -> Console:
        return Console(file=screen, force_terminal=True, width=60, highlight=False)

    monkeypatch.setattr(news, "Console", terminal)
    told = News("flying")
    told.tick(1.0)
    assert screen.getvalue() == ""
    for now in (2.0, 3.0):
        told.tick(now)
    assert "... flying, 3 s" in screen.getvalue() and screen.getvalue().count("\n") == 0
    told.close()
    assert "\x1b[2K" in screen.getvalue()  # the line is wiped


def test_an_error_passes_and_ends_the_telling() -> None:
    with pytest.raises(ValueError, match="no such world"), working("flying"):
        raise ValueError("no such world")


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0 s"), (99.0, "99 s"), (240.0, "4 min"), (9000.0, "2.5 h")]
)
def test_durations_are_short(seconds: float, text: str) -> None:
    assert lasting(seconds) == text
