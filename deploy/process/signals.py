"""What Ctrl-C and SIGTERM do to a command."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class StoppedError(Exception):
    """The user wants it to end."""


def stop_on_signals() -> threading.Event:
    """An event that they set."""
    stop = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        stop.set()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, on_signal)
    return stop


@contextmanager
def stop_meanwhile() -> Iterator[threading.Event]:
    """As :func:`stop_on_signals`, until the end of the block."""
    numbers = (signal.SIGTERM, signal.SIGINT)
    previous: dict[int, Any] = {number: signal.getsignal(number) for number in numbers}
    try:
        yield stop_on_signals()
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


@contextmanager
def stopping_at_signals() -> Iterator[None]:
    """Turn the first Ctrl-C or SIGTERM into StoppedError; later ones do not disturb a landing."""
    told = False

    def on_signal(number: int, frame: FrameType | None) -> None:
        nonlocal told
        if not told:
            told = True
            raise StoppedError("told to stop")

    previous: dict[int, Any] = {
        number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
