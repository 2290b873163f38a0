"""Who sends what must not be used: counted by cause, said now and then, shut out if it goes on.

Offences are charged to the sender that the key names, if it is a member; all others share one
account, so that a flood under a hundred thousand names costs no more memory than one under one.
With access control (``network.security``) nobody can publish under another's key; without it, a
stranger on the same network can get an honest agent shut out, as it could disturb the swarm in many
other ways.  The log gets a line a minute and cause at most.
"""

import logging
import time
from collections import Counter, deque
from collections.abc import Callable, Collection

from swarm.errors import PayloadError

log = logging.getLogger(__name__)
OFFENCES = 20  # within WINDOW, and the sender is shut out
WINDOW = 10.0  # [s]
SHUT_OUT = 30.0  # [s] everything it sends is dropped unread
SAY_AGAIN = 60.0  # [s] between two lines about one cause
STRANGERS = "strangers"  # the account of all who are no members
SHOWN = 64  # letters of a sender's name in the log


class Guard:
    """The account of all senders; used by Zenoh's one thread per subscriber.

    Args:
        members: who has an account of its own.
        clock: monotonic time [s].
    """

    def __init__(
        self, members: Collection[str], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._members, self._clock = frozenset(members), clock
        self._counts: Counter[str] = Counter()
        self._said: dict[str, float] = {}  # when a line about each cause was written [s]
        self._offences: dict[str, deque[float]] = {}
        self._shut_out: dict[str, float] = {}

    @property
    def counts(self) -> dict[str, int]:
        """Messages refused so far, by cause."""
        return dict(self._counts)

    def quarantined(self) -> tuple[str, ...]:
        """Senders that are shut out now; :data:`STRANGERS` for all who are no members."""
        now = self._clock()
        return tuple(sorted(s for s, until in list(self._shut_out.items()) if now < until))

    def admits(self, sender: str) -> bool:
        """Whether to read a message of this sender at all."""
        if self._clock() >= self._shut_out.get(self._account(sender), 0.0):
            return True
        self._counts["quarantined"] += 1
        return False

    def reject(self, sender: str, error: PayloadError) -> None:
        """Count an offence; too many in a row shut its sender out."""
        self._counts[error.cause] += 1
        self._say(
            error.cause,
            f"dropped a message from {sender[:SHOWN]} ({error}; {self._counts[error.cause]} so far "
            "for this cause, said once a minute)",
        )
        if error.cause == "incarnation":  # an older life's; it must not shut out the newer
            return
        account, now = self._account(sender), self._clock()
        recent = self._offences.setdefault(account, deque(maxlen=OFFENCES))
        recent.append(now)
        if len(recent) == OFFENCES and now - recent[0] <= WINDOW:
            self._shut_out[account] = now + SHUT_OUT
            recent.clear()
            self._say(
                f"quarantined/{account}",
                f"{account} shut out for {SHUT_OUT:.0f} s: {OFFENCES} bad messages within "
                f"{WINDOW:.0f} s (said once a minute)",
            )

    def _account(self, sender: str) -> str:
        return sender if sender in self._members else STRANGERS

    def _say(self, cause: str, line: str) -> None:
        now = self._clock()
        if now - self._said.get(cause, -SAY_AGAIN) >= SAY_AGAIN:
            self._said[cause] = now
            log.warning("%s", line)
