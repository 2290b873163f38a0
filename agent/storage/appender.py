"""Records that are appended to a file, whole or not at all, by somebody who has more to do.

A full disk costs the writer nothing but a line a minute: what does not fit waits, the oldest is
given up first, and it is written when there is room again.
"""

import logging
import os
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Self

log = logging.getLogger(__name__)
REMIND = 60.0  # [s] between two lines about the same trouble
RETRY = 1.0  # [s] between two tries
WAITING = 10_000  # records that wait for room


class Trouble:
    """Says what the disk refuses, once a minute as long as it does, and when that is over."""

    def __init__(
        self,
        warn: Callable[[str], None] = log.warning,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._warn, self._clock = warn, clock
        self._due: float | None = None  # None: all is well

    def met(self, what: str, error: OSError) -> None:
        """``what`` could not be written."""
        if self._due is None or self._clock() >= self._due:
            self._due = self._clock() + REMIND
            reason = error.strerror or error
            self._warn(f"{what} cannot be written: {reason}; going on without until it can")

    def over(self, what: str) -> None:
        """It could be written."""
        if self._due is not None:
            self._due = None
            self._warn(f"{what} is written again")


class Appender:
    """An append-only file; a context manager.

    Args:
        path: of the file.
        lines: its records are lines; a torn one at its end is ended before the first new one.
        warn: told of trouble.
        clock: monotonic [s].

    Raises:
        OSError: it cannot be opened.
    """

    def __init__(
        self,
        path: Path,
        *,
        lines: bool = False,
        warn: Callable[[str], None] = log.warning,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._clock = path, clock
        self._trouble = Trouble(warn, clock)
        self._waiting: deque[bytes] = deque(maxlen=WAITING)
        self._retry_at = -1.0
        self._file = path.open("a+b", buffering=0)
        if lines and (size := path.stat().st_size):
            self._file.seek(size - 1)
            if self._file.read(1) != b"\n":
                self._waiting.append(b"\n")

    def write(self, record: bytes) -> None:
        """Append a record, now or as soon as there is room; never raises OSError."""
        self._waiting.append(record)
        if self._clock() >= self._retry_at:
            self._empty()

    def _empty(self) -> None:
        try:
            while self._waiting:
                self._append(self._waiting[0])
                self._waiting.popleft()
        except OSError as error:
            self._retry_at = self._clock() + RETRY
            self._trouble.met(str(self._path), error)
        else:
            self._trouble.over(str(self._path))

    def _append(self, record: bytes) -> None:
        """All of it, or nothing.

        Raises:
            OSError: nothing.
        """
        end = os.fstat(self._file.fileno()).st_size
        try:
            view = memoryview(record)
            while view:  # the last bytes of a disk take a part, and the next write is refused
                view = view[self._file.write(view) :]
        except OSError:
            self._file.truncate(end)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._empty()
        self._file.close()
