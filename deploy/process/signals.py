"""What Ctrl-C and SIGTERM do to a command, by what there is to put away.

Nothing yet, as while it imports, compiles or looks at files: the program ends at once, with one
line.  That is so from its first line on (:func:`end_at_signals`), and a thread sees to it while the
main one is in a library that does not listen.

Something: the command says how it stops for as long as that is so.  A loop asks an event
(:func:`stop_meanwhile`); other work is broken off wherever it is (:func:`stopping_at_signals`) and
unwinds.  Who flies lands, and is not disturbed by a second signal; everybody else has
:data:`UNWIND` for it.

Only the program itself (``deploy.cli.__main__``) turns this on: who imports us keeps the signals
that it has, but for the blocks that it enters.
"""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

UNWIND = 1.5  # [s] for work that is broken off; then the program ends with it as it is
SIGNALS = (signal.SIGINT, signal.SIGTERM)
_once = threading.Lock()


class StoppedError(BaseException):
    """The user wants it to end.  No library's ``except Exception`` may hold that up."""


class _Ending:
    """What the watching thread does at a signal; written by the main thread only.

    Attributes:
        after: how long the main thread has to react [s]; None: as long as it takes.
        words: said by a program that ends at once.
        handled: set by the main thread as soon as it has reacted.
    """

    after: float | None = 0.0
    words = "stopped"


def end_at_signals() -> None:
    """From now on a signal ends the program at once, unless a block says otherwise."""
    for number in SIGNALS:
        signal.signal(number, _end)
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(reader,), name="signals", daemon=True).start()


def say_when_stopped(words: str) -> None:
    """What a program says that ends at once."""
    _Ending.words = words


def _end(number: int, frame: FrameType | None = None) -> None:
    """End the program as it is; of two threads that come here, one does."""
    if not _once.acquire(blocking=False):
        return
    os.write(2, f"swarm: {_Ending.words}\n".encode())
    os._exit(128 + number)


def _watch(reader: int) -> None:
    """End the program where the main thread does not get to it."""
    while byte := os.read(reader, 1):
        number, limit = byte[0], _Ending.after
        if number not in SIGNALS or limit is None:
            continue
        if limit:
            threading.Event().wait(limit)
            if _Ending.after != limit:  # it has put away what it had
                continue
        _end(number)


@contextmanager
def _reacting(react: Callable[[int], None], limit: float | None) -> Iterator[None]:
    """Let ``react`` deal with signals, in the main thread and within ``limit`` [s]."""

    def on_signal(number: int, frame: FrameType | None) -> None:
        react(number)

    after, _Ending.after = _Ending.after, limit
    previous: dict[int, Any] = {n: signal.signal(n, on_signal) for n in SIGNALS}
    try:
        yield
    finally:
        _Ending.after = after
        for number, handler in previous.items():
            signal.signal(number, handler)


@contextmanager
def stop_meanwhile() -> Iterator[threading.Event]:
    """An event that signals set, until the end of the block."""
    stop = threading.Event()
    with _reacting(lambda number: stop.set(), None):
        yield stop


def stop_on_signals(stop: threading.Event) -> None:
    """Let signals set this event, from now to the end of the program."""
    _Ending.after = None
    for number in SIGNALS:
        signal.signal(number, lambda number, frame: stop.set())


@contextmanager
def stopping_at_signals(*, patient: bool = False) -> Iterator[None]:
    """Turn the first signal into StoppedError, wherever the main thread is.

    Args:
        patient: what then has to be done takes as long as it takes, and later signals do not
            disturb it; otherwise the second one ends the program.
    """
    told = False

    def react(number: int) -> None:
        nonlocal told
        if told and not patient:
            _end(number)
        if not told:
            told = True
            raise StoppedError("told to stop")

    with _reacting(react, None if patient else UNWIND):
        yield
