"""How many bytes may be under way on a link, and in what pieces.  Pure: no clock is read here.

The window is what the link carries in one round trip, and a little more: :meth:`Window.slack`
seconds of queue.  Less would leave the link idle; more would only wait in the buffers of Zenoh, of
the kernel and of the radio, in front of everything that is more urgent.  It follows the link as
delay-based congestion control does (Vegas, Brakmo 1995; BBR, Cardwell 2016): the rate of the link
is the largest at which bytes were lately acknowledged, or arrived in a row; while round trips are
about as short as they can be the window grows by what is acknowledged, and at least to what that
rate needs; when they become longer, it becomes just that.
"""

import math
from dataclasses import dataclass, field

FIRST = 262_144  # [bytes] window before anything is known
LEAST_CHUNK, LARGEST_CHUNK = 8_192, 524_288  # [bytes]
CHUNK_TIME = 0.02  # [s] of the link that a chunk takes: how long something urgent may wait for it
SLACK = 0.05  # [s] of queue that is no reason to slow down; threads of a busy machine need as much
JUMP = 32  # times at most that the window grows at once
MEMORY = 15.0  # [s] after which the shortest round trip is measured anew
RECENT = 3.0  # [s] after which the largest rate is
GAIN = 1.5  # times what is needed: acknowledgements wait behind what goes the other way
ROUGHLY = 1.25  # times the shortest round trip is still about the shortest


@dataclass(slots=True)
class Extreme:
    """The largest of recent values: of the present period and the last one.

    Attributes:
        period: how long one is [s].
    """

    period: float
    _present: float = -math.inf
    _last: float = -math.inf
    _began: float = -math.inf

    def add(self, value: float, now: float) -> float:
        """Take a value; the largest."""
        if now > self._began + self.period:
            self._began, self._last, self._present = now, self._present, value
        self._present = max(self._present, value)
        return max(self._present, self._last)


@dataclass(slots=True)
class Window:
    """The window of one link.

    Attributes:
        size: of the window [bytes].
        rate: what the link carries [bytes/s]; 0 before it is known.
        round_trip: shortest lately [s]; 0 before it is known.
    """

    size: int = FIRST
    rate: float = 0.0
    round_trip: float = 0.0
    _shortest: Extreme = field(default_factory=lambda: Extreme(MEMORY))
    _fastest: Extreme = field(default_factory=lambda: Extreme(RECENT))

    def chunk(self) -> int:
        """Size of the next chunk [bytes]."""
        if not self.rate:
            return LEAST_CHUNK
        return int(min(max(self.rate * CHUNK_TIME, LEAST_CHUNK), LARGEST_CHUNK))

    def slack(self) -> float:
        """How much longer than the shortest a round trip may be [s]."""
        own = 4 * self.chunk() / self.rate if self.rate else 0.0
        return max(SLACK, (ROUGHLY - 1) * self.round_trip, own)

    def acknowledged(
        self, count: int, round_trip: float, rate: float, limited: bool, now: float
    ) -> None:
        """Learn from an acknowledgement.

        Args:
            count: bytes that it acknowledges for the first time.
            round_trip: of the chunk that it answers [s].
            rate: at which bytes arrived: during that round trip, or in a row [bytes/s].
            limited: whether the window, not the sender, set how much was under way.
            now: the time [s].
        """
        self.round_trip = -self._shortest.add(-round_trip, now)
        self.rate = self._fastest.add(rate, now)
        target = self.round_trip + self.slack()
        needed = int(GAIN * self.rate * target)
        if round_trip > target:
            self.size = min(self.size, needed)
        else:
            self.size = max(self.size + count * limited, min(needed, JUMP * self.size))
        self.size = max(self.size, 2 * self.chunk())
