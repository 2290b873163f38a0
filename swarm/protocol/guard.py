"""Who sends what must not be used: counted by cause, said once, and shut out when it does not stop.

Offences are charged to the sender that the key names.  With access control
(``network.security``) nobody can publish under another's key; without it, a stranger on the same
network can get an honest agent shut out, as it could disturb the swarm in many other ways.
"""

import logging
import time
from collections import Counter, deque
from collections.abc import Callable

from swarm.errors import PayloadError

log = logging.getLogger(__name__)
OFFENCES = 20  # within WINDOW, and the sender is shut out
WINDOW = 10.0  # [s]
SHUT_OUT = 30.0  # [s] everything it sends is dropped unread


class Guard:
    """The account of all senders; used by Zenoh's one thread per subscriber.

    Args:
        clock: monotonic time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._counts: Counter[str] = Counter()
        self._said: set[tuple[str, str]] = set()
        self._offences: dict[str, deque[float]] = {}
        self._shut_out: dict[str, float] = {}

    @property
    def counts(self) -> dict[str, int]:
        """Messages refused so far, by cause."""
        return dict(self._counts)

    def quarantined(self) -> tuple[str, ...]:
        """Senders that are shut out now."""
        now = self._clock()
        return tuple(sorted(s for s, until in list(self._shut_out.items()) if now < until))

    def admits(self, sender: str) -> bool:
        """Whether to read a message of this sender at all."""
        if self._clock() >= self._shut_out.get(sender, 0.0):
            return True
        self._counts["quarantined"] += 1
        return False

    def reject(self, sender: str, error: PayloadError) -> None:
        """Count an offence; the first of its kind is logged, too many in a row shut out."""
        self._counts[error.cause] += 1
        if (sender, error.cause) not in self._said:
            self._said.add((sender, error.cause))
            log.warning("dropped a message from %s (%s; said once, counted after)", sender, error)
        now = self._clock()
        recent = self._offences.setdefault(sender, deque(maxlen=OFFENCES))
        recent.append(now)
        if len(recent) == OFFENCES and now - recent[0] <= WINDOW:
            self._shut_out[sender] = now + SHUT_OUT
            recent.clear()
            log.warning(
                "%s is shut out for %.0f s: %d bad messages within %.0f s",
                sender,
                SHUT_OUT,
                OFFENCES,
                WINDOW,
            )
