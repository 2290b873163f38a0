"""Nobody waits in the dark: what a command is busy with, for how long, and how far it is.

    with working("flying the greedy pilot") as news:
        for k, world in enumerate(worlds):
            news.say(world, k / len(worlds))

Work that is over within :data:`QUIET` seconds shows nothing.  Then a terminal has one line that is
rewritten, and anything else (a pipe, a log) a line at once and more of them at growing intervals.
All of it goes to standard error, and begins there with ``... ``: an error begins with ``swarm: ``.
What the worlds announce (:mod:`sim.notices`) is part of it.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.live import Live
from rich.text import Text

from sim.notices import MARK, QUIET, shown_elsewhere, under_way

REFRESH = 0.5  # [s] between two states of a terminal's line
INTERVALS = (10.0, 20.0, 30.0, 60.0)  # [s] between the lines of a pipe; the last one goes on


class News:
    """What is going on; any thread may say it."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._detail = ""
        self._done: float | None = None
        self._begun = time.monotonic()
        self._heard = self._begun  # when a person last read something
        self._shown = 0  # lines in a pipe
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._live: Live | None = None
        self._lock = threading.RLock()

    def say(self, detail: str, done: float | None = None) -> None:
        """What it is at, and the share of all that is done; shown when there is time for it."""
        with self._lock:
            self._detail, self._done = detail, done

    def line(self, text: str) -> None:
        """A line that stays."""
        with self._lock:
            self._console.print(text, markup=False)
            self._heard = time.monotonic()

    def text(self, now: float) -> str:
        """The state at a time [monotonic s], in one line."""
        with self._lock:
            seconds, done = now - self._begun, self._done
            detail = ", ".join(filter(None, (self._detail, under_way())))
            parts = [f"{self._what}{': ' if detail else ''}{detail}", lasting(seconds)]
            if done:
                parts += [f"{done:.0%}", f"about {lasting(seconds * (1 / done - 1))} left"]
            return ", ".join(parts)

    def tick(self, now: float) -> None:
        """Show the state, if it is time to."""
        with self._lock:
            if self._console.is_terminal:
                if now - self._begun >= QUIET:
                    self._rewrite(self.text(now))
                return
            pause = INTERVALS[min(self._shown, len(INTERVALS)) - 1] if self._shown else QUIET
            if now - self._heard >= pause:
                self._console.print(MARK + self.text(now), markup=False)
                self._heard, self._shown = now, self._shown + 1

    def close(self) -> None:
        """Leave nothing behind."""
        with self._lock:
            if self._live is not None:
                self._live.stop()

    def _rewrite(self, text: str) -> None:
        if self._live is None:
            self._live = Live(
                console=self._console, auto_refresh=False, transient=True,
                redirect_stdout=False, redirect_stderr=False,
            )  # fmt: skip
            self._live.start()
        line = Text(MARK + text, no_wrap=True, overflow="ellipsis")
        self._live.update(line, refresh=True)


def lasting(seconds: float) -> str:
    """A duration, as short as a person says it."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 100 * 60:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


@contextmanager
def working(what: str) -> Iterator[News]:
    """Show what goes on in the block, should it take long."""
    news, over = News(what), threading.Event()

    def watch() -> None:
        while not over.wait(REFRESH):
            news.tick(time.monotonic())

    thread = threading.Thread(target=watch, name="news", daemon=True)
    with shown_elsewhere():
        thread.start()
        try:
            yield news
        finally:
            over.set()
            thread.join()
            news.close()
