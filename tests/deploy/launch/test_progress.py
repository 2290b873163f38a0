"""What `swarm up` shows meanwhile, on 80 columns: metres for flights, few lines for many agents."""

import io

import pytest
from rich.console import Console

from deploy.launch import progress
from deploy.launch.progress import Progress
from tests.deploy.observe.crowds import crowd, reports


def screen(
    monkeypatch: pytest.MonkeyPatch, size: int, metres: bool, terminal: bool, height: int = 24
) -> str:
    """What is shown of a crowd in which the last agent is behind."""
    out = io.StringIO()
    console = Console(file=out, width=80, height=height, force_terminal=terminal, color_system=None)
    monkeypatch.setattr(progress, "Console", lambda: console)
    config = crowd(size)
    with Progress(config) as shown:
        for report in reports(config, metres):
            shown.take(report)
        shown.show()
    return out.getvalue()


@pytest.mark.parametrize("terminal", [True, False])
def test_flights_are_told_in_metres_on_a_terminal_as_in_a_pipe(
    monkeypatch: pytest.MonkeyPatch, terminal: bool
) -> None:
    text = screen(monkeypatch, 4, True, terminal)
    assert ("flight [m]" if terminal else "flights [m] 10.0 11.0 12.0 13.0") in text
    assert "13.0" in text
    assert "return" in screen(monkeypatch, 4, False, terminal)


@pytest.mark.parametrize(("size", "height"), [(16, 24), (64, 24), (64, 50)])
def test_a_crowd_fits_a_screen_with_whoever_is_behind(
    monkeypatch: pytest.MonkeyPatch, size: int, height: int
) -> None:
    text = screen(monkeypatch, size, False, True, height)
    table = text[text.rindex("swarm crowd") :]
    shown = [line for line in table.splitlines() if not line.startswith("\x1b")]
    assert len(shown) <= height
    assert max(map(len, shown)) <= 80
    assert "…" not in table
    assert f"drone{size - 1:02d}   300/1000" in table
    assert "1 (drone01)" in table


def test_a_line_of_a_crowd_sums_up(monkeypatch: pytest.MonkeyPatch) -> None:
    text = screen(monkeypatch, 64, False, False)
    assert "round 300/1000, agents 64/64, return +0.00 to +0.63, median +0.32" in text
