"""A line a minute in an agent's log, however long a round or a wait lasts.

Interface: :func:`logbook_kept` around the agent's life, :func:`line_of` what it writes.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from swarm.reports.telemetry import AgentStatus

log = logging.getLogger(__name__)
EVERY = 60.0  # [s]
SILENT = 2.0  # [s] a neighbour whose last word is older is named


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
    heard = status.neighbours.items()
    silent = [name for name, word in heard if word.age is None or word.age > SILENT]
    parts.append(f"{len(status.neighbours)} neighbours")
    if silent:
        parts.append(f"no word for {SILENT:.0f} s from {', '.join(silent)}")
    return ", ".join(parts)
