"""Waits for the time of day, where certificates go by it.

A computer without a clock of its own begins in 1970, or where it was switched off, until somebody
tells it the time.  Until then its certificate is "not valid yet" to itself and to everybody else:
no mistake of the user's, and no reason to end.

Interface: :func:`await_clock`.
"""

import logging
import threading
import time

from agent.daemon.notify import Systemd
from swarm.errors import TooEarlyError
from swarm.wire.security import Security

LOOK_EVERY = 1.0  # [s]
TELL_EVERY = 60.0  # [s]

log = logging.getLogger(__name__)


def await_clock(security: Security, agent: str, stop: threading.Event, systemd: Systemd) -> bool:
    """Return when the agent's certificate is valid; False: told to stop before.

    Raises:
        ConfigError: a file of ``[network.security]`` will not do, whatever the time is.
    """
    told = -TELL_EVERY
    while not stop.is_set():
        try:
            security.check(agent)
        except TooEarlyError as error:
            if time.monotonic() >= told + TELL_EVERY:
                told = time.monotonic()
                log.warning("%s; waiting until the clock is set", error)
        else:
            return True
        systemd.starting("waiting until the clock is set", 10 * LOOK_EVERY)
        stop.wait(LOOK_EVERY)
    return False
