"""What takes long in the worlds, told while it lasts: compiling, baking light.

    with during("baking the light of indoor-long, once"):
        ...

Work that is over within :data:`QUIET` seconds is not told.  What is told is an announcement, not an
error: a record of the logger ``sim.notices`` where somebody listens to that, else one line on
standard error that begins with ``... ``.  A program that shows by itself what goes on asks
:func:`under_way` for it, and keeps the lines away with :func:`shown_elsewhere`.
"""

import logging
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

log = logging.getLogger(__name__)
QUIET = 2.0  # [s] after which a person wants to know what is going on
MARK = "... "  # begins a line that announces

_works: list["Work"] = []  # under way, the innermost last
_shown = 0  # programs that show what is under way themselves


class Work:
    """Something that may take long, in one stretch or several; told once, when it adds up."""

    def __init__(self, what: str) -> None:
        self.what = what
        self._spent = 0.0  # [s] in the stretches that are over
        self._begun = 0.0  # of the present one [monotonic s]
        self._told = False
        self._timer: threading.Timer | None = None

    def begin(self) -> None:
        """A stretch begins."""
        _works.append(self)
        self._begun = time.monotonic()
        if not self._told:
            self._timer = threading.Timer(max(0.0, QUIET - self._spent), self._tell)
            self._timer.daemon = True
            self._timer.start()

    def end(self) -> None:
        """It is over."""
        if self._timer is not None:
            self._timer.cancel()
        self._spent += time.monotonic() - self._begun
        _works.remove(self)

    def _tell(self) -> None:
        self._told = True
        if _shown:
            return
        if log.hasHandlers():
            log.info("%s", self.what)
        else:
            print(f"{MARK}{self.what}", file=sys.stderr, flush=True)


@contextmanager
def during(what: str) -> Iterator[None]:
    """Tell what is going on, should the block take long."""
    work = Work(what)
    work.begin()
    try:
        yield
    finally:
        work.end()


def under_way() -> str:
    """What this process is busy with, the innermost work; empty if nothing."""
    works = _works[-1:]
    return works[0].what if works else ""


@contextmanager
def shown_elsewhere() -> Iterator[None]:
    """No lines of our own: the caller shows what is under way."""
    global _shown  # noqa: PLW0603  (a count of blocks, like a lock's)
    _shown += 1
    try:
        yield
    finally:
        _shown -= 1
