"""What `swarm up` shows while agents learn: a live table, or lines where there is no terminal."""

import threading
import time
from collections.abc import Sequence
from typing import Self

from rich import box
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from agent.config.experiment import SwarmFile
from deploy.observe import crowd
from swarm.mixing.consensus import sketch_errors
from swarm.reports.telemetry import RoundReport

LINES_EVERY = 2.0  # [s] between lines where the output is not a terminal
BESIDE = 10  # lines of a screen beside the rows: title, headings, what is left out, a line said


class Progress:
    """Collects reports (on any thread) and shows them (on the caller's); a context manager."""

    def __init__(self, config: SwarmFile) -> None:
        self._config = config
        self._console = Console()
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._reports: dict[str, RoundReport] = {}
        self._first: dict[str, tuple[float, float]] = {}  # round and monotonic time [s] of arrival
        self._lock = threading.Lock()
        self._next_line = 0.0
        self._start = time.monotonic()

    def take(self, report: RoundReport) -> None:
        """A report came in."""
        if report.agent not in self._config.members:
            return
        with self._lock:
            if not self._reports:
                started = time.monotonic() - self._start
                self.say(f"first round after {started:.1f} s")
            self._first.setdefault(report.agent, (self._reached(report), time.monotonic()))
            self._reports[report.agent] = report

    @property
    def complete(self) -> bool:
        """Whether every agent has reported."""
        with self._lock:
            return len(self._reports) == len(self._config.members)

    @property
    def round(self) -> int:
        """Newest round that every agent has reported."""
        with self._lock:
            return int(min(map(self._reached, self._reports.values()), default=0))

    def _reached(self, report: RoundReport) -> float:
        return self._config.progress(report)

    def say(self, text: str) -> None:
        """Print one line above the live table."""
        elapsed = time.monotonic() - self._start
        self._console.print(
            f"[{elapsed:6.1f} s] {text}", highlight=False, markup=False, soft_wrap=True
        )

    def show(self) -> None:
        """Refresh."""
        with self._lock:
            reports = dict(self._reports)
        if self._console.is_terminal:
            self._live.update(self._picture(reports), refresh=True)
        elif reports and time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + LINES_EVERY
            self.say(self._line(reports))

    def _time_left(self, reports: dict[str, RoundReport]) -> float | None:
        """Seconds to the end at the pace so far [s]."""
        slowest = min(reports.values(), key=self._reached)
        first, began = self._first[slowest.agent]
        done = self._reached(slowest) - first
        if done <= 0:
            return None
        return (self._config.rounds - self._reached(slowest)) * (time.monotonic() - began) / done

    def _line(self, reports: dict[str, RoundReport]) -> str:
        errors, left = _errors(reports), self._time_left(reports)
        parts = [
            f"round {min(map(self._reached, reports.values())):.0f}/{self._config.rounds}",
            f"agents {len(reports)}/{len(self._config.members)}",
            _gains([reports[agent] for agent in sorted(reports)]),
            f"consensus error {max(errors.values(), default=0.0):.3f}",
        ]
        return ", ".join(parts) + (f", {_time(left)} left" if left is not None else "")

    def _picture(self, reports: dict[str, RoundReport]) -> RenderableType:
        """A row for each agent; of more than the screen holds, for those furthest behind."""
        left = self._time_left(reports) if reports else None
        members = self._config.members
        title = f"swarm {self._config.name}"
        title += f", {_time(left)} left" if left is not None else ""
        room = crowd.shown(len(members), self._console.height, BESIDE)
        if room == len(members):
            return self._table(title, members, reports)
        agents = sorted(members, key=lambda a: self._reached(reports[a]) if a in reports else -1.0)
        summary = Text(self._line(reports) if reports else "starting")
        rest = Text(f"and {len(members) - room} more, no further behind")
        return Group(self._table(title, agents[:room], reports), rest, summary)

    def _table(self, title: str, agents: Sequence[str], reports: dict[str, RoundReport]) -> Table:
        errors = _errors(reports)
        flights = _fly(list(reports.values()))
        named = len(self._config.members) <= crowd.MANY
        table = Table(
            title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
        )
        table.add_column("agent", overflow="fold")
        gain = escape("flight [m]") if flights else "return"
        for heading in ("round", gain, "consensus\nerror", "ms/round"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("neighbours\n(missing)", overflow="fold")
        for agent in agents:
            report = reports.get(agent)
            if report is None:
                table.add_row(agent, "starting")
                continue
            table.add_row(
                agent,
                f"{self._reached(report):.0f}/{self._config.rounds}",
                _gain(report, flights),
                f"{errors[agent]:.3f}" if agent in errors else "",
                f"{report.seconds * 1e3:.1f}",
                _nearby(report, named),
            )
        return table

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._live.stop()


def _fly(reports: list[RoundReport]) -> bool:
    """Whether the worlds tell how long flights are."""
    return any(report.distance is not None for report in reports)


def _gain(report: RoundReport, flights: bool) -> str:
    """What the task is about: the length of flights [m], or else the return."""
    if not flights:
        return f"{report.value:+.3f}"
    return "" if report.distance is None else f"{report.distance:.1f}"


def _gains(reports: list[RoundReport]) -> str:
    """Lengths of flights where the worlds tell them, else returns; of a crowd, their spread."""
    lengths = [report.distance for report in reports if report.distance is not None]
    if len(reports) > crowd.MANY:
        if lengths:
            return f"flights [m] {crowd.spread(lengths, '.1f')}"
        return f"return {crowd.spread([report.value for report in reports])}"
    if lengths:
        return "flights [m] " + " ".join(f"{report.distance or 0.0:.1f}" for report in reports)
    return "return " + " ".join(f"{report.value:+.2f}" for report in reports)


def _nearby(report: RoundReport, named: bool) -> str:
    """Whose parameters were mixed in, and in brackets whose did not come."""
    if named:
        return " ".join((*report.weights, *(f"({name})" for name in report.missing)))
    missing = f" ({crowd.named(report.missing, 2)})" if report.missing else ""
    return f"{len(report.weights)}{missing}"


def _time(seconds: float) -> str:
    """``90 s``, or minutes and hours where there are many."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def _errors(reports: dict[str, RoundReport]) -> dict[str, float]:
    """Distance of each agent from the mean, from the newest sketches."""
    return sketch_errors({agent: report.sketch for agent, report in reports.items()})
