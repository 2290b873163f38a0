"""Messages cut into chunks, acknowledged, resumed where a link broke.  Pure: no clock, no thread.

:class:`Outgoing` is the sender's end of a link, :class:`Incoming` the receiver's.  A link delivers
in order or breaks; so what is missing is missing from some place on, and the sender goes back to
that place and no further.  It learns of it from the receiver, who finds the next chunk to be a
later one, or, when nothing comes any more, from the answer to an :class:`~swarm.wire.frames.Ask`
that was sent behind the chunks it asks about.  Nothing is sent again for being slow.
"""

from collections import deque
from dataclasses import dataclass, field

from swarm.wire.buffers import Body, new_body
from swarm.wire.frames import Ack, Ask, Chunk
from swarm.wire.window import Window

STALL = 0.25  # [s] beyond two round trips without an acknowledgement, then the sender asks
AHEAD = 2  # messages begun and not yet acknowledged, at most
PARTS = 4  # acknowledgements a window
LARGE = 32_768  # [bytes] below, a body fits a packet of Zenoh's and is as fast without
LARGEST = 67_108_864  # [bytes] above, shared memory would take too much of the machine's
TRIES = 2  # failures in a row, and shared memory is no longer used towards this receiver


@dataclass(slots=True)
class Message:
    """A message on its way out.

    Attributes:
        kind: for the protocol above.
        header, body: what it says; neither changes any more.
        slot: a newer message of the same kind and slot replaces it while it waits.
        at: its place in the stream.
    """

    kind: str
    header: bytes
    body: Body
    slot: int = 0
    at: int = 0

    @property
    def end(self) -> int:
        """Place after it."""
        return self.at + 1 + len(self.body)


@dataclass(frozen=True, slots=True)
class Part:
    """What to send next.

    Attributes:
        frame: says what it is.
        body: whose part it is, ``size`` bytes from ``frame.offset`` on.
        size: its length.
        shared: whether to send it through shared memory.
    """

    frame: Chunk
    body: Body
    size: int
    shared: bool


@dataclass(slots=True)
class Outgoing:
    """The sender's end.

    Attributes:
        agent, life: own.
        window: how much may be under way.
        waiting: newest message of each kind and slot that has not begun to leave.
        under_way: messages begun and not acknowledged, in order.
        begun, next, acknowledged: places of the stream: end of what has been begun, of what has
            been sent, of what has arrived.
        progress: when the last acknowledgement came that was news [s].
        host: name of the own machine; see :class:`~swarm.wire.frames.Ack`.
        replaced, resumes, resent: messages that a newer one replaced; times the sender went back;
            bytes that it sent again.
        delivered: messages that have arrived.
    """

    agent: str
    life: str
    window: Window = field(default_factory=Window)
    waiting: dict[tuple[str, int], Message] = field(default_factory=dict)
    under_way: deque[Message] = field(default_factory=deque)
    stream: int = 0
    attempt: int = 0
    begun: int = 0
    next: int = 0
    acknowledged: int = 0
    progress: float = 0.0
    host: str = ""
    replaced: int = 0
    resumes: int = 0
    resent: int = 0
    delivered: int = 0
    _asked: float = 0.0
    _sent: int = 0  # largest ``next`` of this stream
    _wanted: int = 0  # place up to which an acknowledgement is on its way
    _before: dict[float, int] = field(default_factory=dict)  # ``acknowledged`` when a chunk left
    _receiver: str = ""  # its life
    _near: bool = False  # whether it is on the own machine
    _shared_at: float = -1.0  # when the whole body left that is not acknowledged [s]; else -1
    _safe: int = 0  # place from which on shared memory may be tried
    _failures: int = 0  # of shared memory in a row

    def offer(self, message: Message) -> None:
        """Take a message; it replaces one of its kind and slot that has not begun to leave."""
        self.replaced += (message.kind, message.slot) in self.waiting
        self.waiting[message.kind, message.slot] = message

    @property
    def backlog(self) -> int:
        """Bytes handed over that are not known to have arrived."""
        waiting = sum(len(message.body) for message in self.waiting.values())
        return waiting + self.begun - self.acknowledged

    def chunk(self, now: float) -> "Part | None":
        """What to send now; None if nothing may."""
        if self.next == self.begun and not self._begin(now):
            return None
        message = next(m for m in self.under_way if self.next < m.end)
        offset = max(0, self.next - message.at - 1)
        left, flying = len(message.body) - offset, self.next - self.acknowledged
        if shared := self._shares_now(message, offset):
            size, self._shared_at = left, now
        else:
            size = min(left, self.window.chunk())
            if flying and flying + size > self.window.size:
                return None
        place, self.next = self.next, message.at + 1 + offset + size
        self._sent = max(self._sent, self.next)
        last = self.next == message.end
        wants = last or self.next - self._wanted >= self.window.size // PARTS
        wants = wants or self.next - self.acknowledged + size > self.window.size
        if wants:
            self._wanted = self.next
            self._before[now] = self.acknowledged
        frame = Chunk(
            self.agent, self.life, self.stream, self.attempt, place, message.kind, offset,
            len(message.body), wants, now, b"" if offset else message.header,
        )  # fmt: skip
        return Part(frame, message.body, size, shared)

    def shares(self, length: int) -> bool:
        """Whether a body of so many bytes goes at once, through shared memory."""
        return self._near and LARGE <= length <= LARGEST and self._failures < TRIES

    def _shares_now(self, message: Message, offset: int) -> bool:
        return offset == 0 and message.at >= self._safe and self.shares(len(message.body))

    def share_no_more(self) -> None:
        """There is no room in shared memory."""
        self._failures = TRIES

    def _begin(self, now: float) -> bool:
        if not self.waiting or len(self.under_way) >= AHEAD:
            return False
        message = self.waiting.pop(next(iter(self.waiting)))
        if not self.under_way:
            self.progress = now
        message.at, self.begun = self.begun, self.begun + 1 + len(message.body)
        self.under_way.append(message)
        return True

    def ask(self, now: float, at_once: bool = False) -> Ask | None:
        """A question, when an answer is overdue (or ``at_once``: the link has just come back)."""
        if self.next == self.acknowledged or (not at_once and self.due(now) > 0):
            return None
        self._asked = now
        return Ask(self.agent, self.life, self.stream, self.attempt, self.next, now)

    def due(self, now: float) -> float:
        """Time until a question is [s]."""
        patience = STALL + 2 * (self.window.round_trip + self.window.slack())
        return max(self.progress, self._asked) + patience - now

    def acknowledge(self, ack: Ack, now: float) -> None:
        """Learn what has arrived, and go back if something has not."""
        if (ack.to, ack.stream) != (self.life, self.stream) or ack.have > self._sent:
            return
        if ack.life != self._receiver:
            self._receiver, self._failures = ack.life, 0
        self._near = bool(self.host) and ack.host == self.host
        if ack.sent == self._shared_at and not ack.lost:
            self._failures = 0 if ack.shared else self._failures + 1
            self._shared_at = -1.0
        new, limited = ack.have - self.acknowledged, self.next < self.begun or bool(self.waiting)
        if new > 0:
            self.acknowledged, self.progress = ack.have, now
            self.next = max(self.next, ack.have)
            if not ack.shared:
                trip = max(now - ack.sent, 1e-6)
                before = self._before.pop(ack.sent, self.acknowledged - new)
                rate = max((ack.have - before) / trip, ack.rate or 0.0)
                self.window.acknowledged(new, trip, rate, limited, now)
        while self.under_way and self.under_way[0].end <= self.acknowledged:
            self.under_way.popleft()
            self.delivered += 1
        if not self.under_way:
            self._before.clear()
        if ack.lost and ack.attempt == self.attempt:
            self._go_back(ack.have, now)

    def _go_back(self, have: int, now: float) -> None:
        self.attempt += 1
        self.resumes += 1
        self._failures += self._shared_at >= 0  # what is sent again goes over the network
        self._shared_at, self._safe, self.progress = -1.0, self.next, now
        if have >= self.acknowledged:
            self.resent += self.next - have
            self.next = self._wanted = have
            return
        # The receiver has begun a new life, so the stream does; what is newer goes instead.
        self.resent += self.next - self.under_way[0].at if self.under_way else 0
        self.stream, self.attempt = self.stream + 1, 0
        while self.under_way:
            message = self.under_way.pop()
            self.waiting = {(message.kind, message.slot): message, **self.waiting}
        self.begun = self.next = self.acknowledged = 0
        self._wanted = self._sent = self._safe = 0


@dataclass(frozen=True, slots=True)
class Arrival:
    """A message that has arrived.

    Attributes:
        sender, life: whose.
        kind, header, body: as sent; the body is the receiver's own memory.
    """

    sender: str
    life: str
    kind: str
    header: bytes
    body: Body


@dataclass(slots=True)
class Incoming:
    """The receiver's end: one stream of one life of one sender.

    Attributes:
        agent, life: own.
        host: own machine's name, as far as shared memory goes; empty without.
        stream: the sender's.
        have: places that have arrived, in order.
        heard: when the last byte came [s].
    """

    agent: str
    life: str
    host: str = ""
    stream: int = -1
    have: int = 0
    heard: float = 0.0
    _header: bytes = b""
    _body: bytearray | None = None
    _first: tuple[float, int] = (0.0, 0)  # when this message's first part had come, its length
    _rate: float | None = None  # of this message [bytes/s]
    _done: bool = False  # whether it is complete

    def begins(self, chunk: Chunk) -> bool:
        """Whether this is the first part of a message, and the next to come."""
        fresh = chunk.stream != self.stream and chunk.place == 0
        return chunk.offset == 0 and (fresh or self._expects(chunk))

    def _expects(self, chunk: Chunk) -> bool:
        return chunk.stream == self.stream and chunk.place == self.have

    def accept(
        self, chunk: Chunk, part: Body, now: float, wanted: bool = True, shared: bool = False
    ) -> tuple[Ack | None, Arrival | None]:
        """Take a part: what to answer, and the message if it is complete.

        Args:
            chunk, part: as received.
            now: the time [s].
            wanted: whether to keep the message that begins here; one that is refused counts as
                received, so that its sender goes on to the next.
            shared: whether the part came through shared memory.
        """
        self.heard = now
        if chunk.stream != self.stream and chunk.place == 0:
            self.stream, self.have, self._body = chunk.stream, 0, None
        if not self._expects(chunk):
            lost = chunk.stream != self.stream or chunk.place > self.have
            again = not lost and chunk.wants
            return (self._ack(chunk, lost, now, shared) if lost or again else None), None
        if chunk.offset == 0:
            self._header, self._first, self._rate = chunk.header, (now, len(part)), None
            whole = len(part) == chunk.total
            self._body = None if whole or not wanted else new_body(chunk.total)
        end = chunk.offset + len(part)
        self.have += len(part) + (chunk.offset == 0)
        if now > self._first[0] and end > self._first[1]:
            self._rate = (end - self._first[1]) / (now - self._first[0])
        arrival: Arrival | None = None
        if self._body is not None:
            self._body[chunk.offset : end] = part
        self._done = end == chunk.total
        if self._done:
            body = part if self._body is None else self._body
            if wanted and len(body) == chunk.total:
                arrival = Arrival(chunk.agent, chunk.life, chunk.kind, self._header, body)
            self._body = None
        return (self._ack(chunk, False, now, shared) if chunk.wants else None), arrival

    def answer(self, ask: Ask, now: float) -> Ack:
        """What has arrived, and whether something is missing before the question."""
        known = ask.stream == self.stream
        return self._ack(ask, not known or self.have < ask.place, now, False)

    def _ack(self, frame: Chunk | Ask, lost: bool, now: float, shared: bool) -> Ack:
        whole = isinstance(frame, Chunk) and frame.offset and self._done
        rate = self._rate if whole and not lost else None
        have = self.have if frame.stream == self.stream else 0
        return Ack(
            self.agent, self.life, frame.life, frame.stream, frame.attempt, have, lost, frame.sent,
            rate, self.host, shared,
        )  # fmt: skip
