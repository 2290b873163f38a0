"""A line a minute in an agent's log, however long a round or a wait lasts.

Interface: :func:`logbook_kept` around the agent's life, :func:`line_of` what it writes.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from swarm.reports.telemetry import AgentStatus, NeighbourStatus

log = logging.getLogger(__name__)
EVERY = 60.0  # [s]


@contextmanager
def logbook_kept(ask: Callable[[], AgentStatus], every: float = EVERY) -> Iterator[None]:
    """Meanwhile a thread logs how the agent is.

    Args:
        ask: how it is; called on that thread.
        every: how often [s].
    """
    done = threading.Event()

    def keep() -> None:
        round_, since = -1, time.monotonic()
        while not done.wait(every):
            status, now = ask(), time.monotonic()
            if status.round != round_:
                round_, since = status.round, now
            log.info("%s", line_of(status, now - since))

    thread = threading.Thread(target=keep, name="logbook", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def line_of(status: AgentStatus, stuck: float) -> str:
    """How an agent is.

    Args:
        status: what it says of itself.
        stuck: for how long it has been seen in the same round [s].
    """
    parts = [f"round {status.round} of {status.rounds}: {status.state}"]
    if stuck > 0:
        parts.append(f"in this round for {stuck:.0f} s")
    if status.distance is not None:
        parts.append(f"flights {status.distance:.1f} m")
    elif status.value is not None:
        parts.append(f"return {status.value:+.3f}")
    if status.neighbours:
        heard = (_heard(name, word) for name, word in status.neighbours.items())
        parts.append(f"heard {', '.join(heard)}")
    return ", ".join(parts)


def _heard(name: str, word: NeighbourStatus) -> str:
    return f"{name} never" if word.age is None else f"{name} {word.age:.1f} s ago"
