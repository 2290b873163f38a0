"""How many bytes may be under way on a link, and in what pieces.  Pure: no clock is read here.

The window is what the link carries in one round trip, and a little more: :func:`Window.slack`
seconds of queue.  Less would leave the link idle; more would only wait in the buffers of Zenoh, of
the kernel and of the radio, in front of everything that is more urgent.  It follows the link as
delay-based congestion control does (Vegas, Brakmo 1995; BBR, Cardwell 2016): while round trips are
about as short as they can be it grows by what is acknowledged, and jumps to what the receiver has
seen arrive in a row; when they become longer, what is queued is the difference, and the window
becomes the measured throughput times the round trip that there should be.
"""

from dataclasses import dataclass, field

FIRST = 262_144  # [bytes] window before anything is known
LEAST_CHUNK, LARGEST_CHUNK = 8_192, 524_288  # [bytes]
CHUNK_TIME = 0.02  # [s] of the link that a chunk takes: how long something urgent may wait for it
SLACK = 0.05  # [s] of queue that is no reason to slow down; threads of a busy machine need as much
JUMP = 32  # times at most that the window grows at once
MEMORY = 15.0  # [s] after which the shortest round trip is measured anew
ROUGHLY = 1.25  # times the shortest round trip is still about the shortest


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
    _shortest: tuple[float, float] = (0.0, 0.0)  # of the present and of the last period [s]
    _period: float = 0.0  # began [s]
    _epoch: float = 0.0  # throughput is measured since [s]
    _arrived: int = field(default=0)  # since then [bytes]

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
        self, count: int, round_trip: float, rate: float | None, limited: bool, now: float
    ) -> None:
        """Learn from an acknowledgement.

        Args:
            count: bytes that it acknowledges for the first time.
            round_trip: of the chunk that it answers [s].
            rate: at which the receiver saw the message come [bytes/s].
            limited: whether the window, not the sender, set how much was under way.
            now: the time [s].
        """
        self._measure(round_trip, now)
        self._arrived += count
        since = now - self._epoch
        throughput = self._arrived / since if since > 0 else 0.0
        if since >= round_trip:
            self._epoch, self._arrived = now, 0
        if rate:
            self.rate = rate
        target = self.round_trip + self.slack()
        if round_trip <= target:
            if limited:
                self.size += count
            if rate:
                self.size = max(self.size, min(int(rate * target), JUMP * self.size))
        elif since >= round_trip:
            self.size = min(self.size, int(throughput * target))
        self.size = max(self.size, 2 * self.chunk())

    def idle(self, now: float) -> None:
        """Nothing was under way until now: throughput is measured from here."""
        self._epoch, self._arrived = now, 0

    def _measure(self, round_trip: float, now: float) -> None:
        present, last = self._shortest
        if now - self._period > MEMORY:
            self._period, last, present = now, present or round_trip, round_trip
        present = min(present, round_trip)
        self._shortest = (present, last)
        self.round_trip = min(present, last)
