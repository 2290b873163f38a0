"""Links: messages to neighbours at whatever rate each can take, and what comes back.

Interface::

    with Links(transport, agent, life, receiver) as links:
        links.send("drone2", "round", header, body)   # returns at once, at any size and bandwidth
        links.note("drone2", "beat", header)          # a header alone
        links.report()["drone2"]                      # rate, latency, backlog, age, ...
        links.moved("drone2")                         # when bytes last moved, either way [s]

* **Handing over** takes no time: the body is not copied and must not change any more (the vectors
  of :mod:`swarm.wire.buffers` never do).  Of each kind and slot the newest message replaces one
  that has not begun to leave; one that has begun is finished first.
* **One thread a neighbour** sends, in chunks, no more than a window (:mod:`swarm.wire.window`) that
  the receiver has not acknowledged (:mod:`swarm.wire.stream`).  A slow, frozen or absent neighbour
  holds up its own thread only; its newest message and one or two before it are kept.
* **Nothing is sent twice** unless the link was lost; then it goes on where it broke.  Messages of
  one neighbour arrive in order, each once, unless they are replaced or their receiver starts anew.
* **Notes** go at once, express and at a higher priority, and may be lost.  They do not overtake:
  while messages are under way, bytes that move are sign of life enough, and a note goes behind.
* **On one machine** large bodies go through shared memory; should that fail, over the network.
* What arrives is handed to a :class:`Receiver` on the thread that listens: it must not block.

The protocol above decides what to send, to whom and when; it is told of bytes that move, so that no
time limit need cut a transfer that is under way.
"""

import logging
import threading
import time
from typing import Annotated, Protocol, Self

import msgspec
import zenoh

from swarm.errors import PayloadError
from swarm.wire import frames
from swarm.wire.buffers import Body
from swarm.wire.frames import Ack, Ask, Chunk, Note
from swarm.wire.shared import SharedMemory, machine
from swarm.wire.stream import Arrival, Incoming, Message, Outgoing, Part
from swarm.wire.transport import Transport

log = logging.getLogger(__name__)
PROBE = 65_536  # [bytes] sent to a new neighbour, so that the first vector finds the link measured
PROBING = "probe"  # its kind; never handed to the receiver
SILENT = 2.0  # [s] without progress, then a line says so
LIVES = 2  # of one sender that are listened to at a time; the receiver above knows which counts
END = 1.0  # [s] for a sender's thread to end; likewise for the last acknowledgement to come
DRAIN_STEP = 0.02  # [s]
Count = Annotated[int, msgspec.Meta(ge=0)]


class LinkReport(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One direction of an edge, as its sender sees it.

    Attributes:
        rate: what the link carries [bit/s]; None before it was measured, or with shared memory.
        latency: half of the shortest round trip lately [s].
        window: that may be under way [bytes].
        backlog: handed over and not known to have arrived [bytes].
        age: since the last byte moved, either way [s]; None before.
        delivered: messages that have arrived.
        replaced: messages that a newer one replaced before they began to leave.
        resumes: times that the link was lost and the rest sent again.
        resent: bytes that were sent again.
        undelivered: messages given up, because their receiver left.
        shared: whether the newest went through shared memory.
    """

    rate: float | None = None
    latency: float | None = None
    window: Count = 0
    backlog: Count = 0
    age: float | None = None
    delivered: Count = 0
    replaced: Count = 0
    resumes: Count = 0
    resent: Count = 0
    undelivered: Count = 0
    shared: bool = False


class Receiver(Protocol):
    """The protocol above, as a link sees it; called on the thread that listens."""

    def admits(self, sender: str) -> bool:
        """Whether to read anything of this sender's."""
        ...

    def check(self, sender: str, life: str, kind: str, header: bytes, length: int) -> None:
        """Judge a message of which the first part has come, before ``length`` bytes are reserved.

        Raises:
            PayloadError: it is not wanted.
        """
        ...

    def refuse(self, sender: str, error: PayloadError) -> None:
        """Count what was refused."""
        ...

    def receive(self, arrival: Arrival) -> None:
        """Take a message that has arrived."""
        ...

    def note(self, sender: str, life: str, kind: str, header: bytes) -> None:
        """Take a note."""
        ...

    def progress(self, sender: str) -> None:
        """Part of a message has come, or part of ours has arrived."""
        ...


class Links:
    """All links of one agent; a context manager.

    Args:
        transport: carries the frames.
        agent, life: own.
        receiver: takes what arrives.
        shared_memory: whether large bodies may go through /dev/shm.
    """

    def __init__(
        self,
        transport: Transport,
        agent: str,
        life: str,
        receiver: Receiver,
        shared_memory: bool = True,
    ) -> None:
        self._transport, self._agent, self._life = transport, agent, life
        self._receiver = receiver
        self._host = machine() if shared_memory else ""
        self._shared = SharedMemory()
        self._links: dict[str, _Link] = {}
        self._incoming: dict[str, dict[str, Incoming]] = {}
        self._lock = threading.Lock()
        transport.open(self._on_frame, self._on_change)

    def send(self, to: str, kind: str, header: bytes, body: Body = b"", slot: int = 0) -> None:
        """Hand a message over; ``body`` must not change any more.

        It replaces what waits of its kind and ``slot``.  Who needs each of two rounds that follow
        each other gives them different slots.
        """
        self._link(to).offer(Message(kind, header, body, slot))

    def note(self, to: str, kind: str, header: bytes) -> None:
        """Send a header at once, and it may be lost; or behind what has not arrived yet."""
        with self._lock:
            link = self._links.get(to)
        if link is not None and link.busy():
            link.offer(Message(kind, header, b""))
            return
        note = frames.encode(Note(self._agent, self._life, kind, header))
        self._transport.put(to, note, b"", urgent=True)

    def reach(self, to: str) -> None:
        """Prepare the link to a neighbour: it is measured before the first vector needs it."""
        self._link(to)

    def forget(self, to: str) -> None:
        """A neighbour has left for good: give up what it has not received, end its thread."""
        with self._lock:
            link = self._links.pop(to, None)
            self._incoming.pop(to, None)
        if link is not None:
            link.close()

    def moved(self, neighbour: str) -> float:
        """Monotonic time at which bytes last moved, either way [s]; 0 before."""
        with self._lock:
            lives = self._incoming.get(neighbour, {}).values()
            link = self._links.get(neighbour)
            return max([link.progress() if link else 0.0, *(i.heard for i in lives)])

    def report(self) -> dict[str, LinkReport]:
        """Every link, by neighbour."""
        with self._lock:
            links = list(self._links.items())
        return {to: link.report(self.moved(to)) for to, link in links}

    def _link(self, to: str) -> "_Link":
        with self._lock:
            link = self._links.get(to)
            if link is None:
                outgoing = Outgoing(self._agent, self._life, host=self._host)
                link = self._links[to] = _Link(self._transport, to, outgoing, self._shared)
                link.start()
            return link

    def _on_change(self, neighbour: str, listens: bool) -> None:
        with self._lock:
            link = self._links.get(neighbour)
        if link is not None:
            link.route(listens)

    def _on_frame(self, sender: str, raw: bytes, part: Body, shared: bool) -> None:
        if not self._receiver.admits(sender):
            return
        try:
            frame = frames.decode(raw, sender)
            match frame:
                case Chunk():
                    self._on_chunk(frame, part, shared)
                case Ack():
                    with self._lock:
                        link = self._links.get(sender)
                    if link is not None and link.acknowledge(frame):
                        self._receiver.progress(sender)
                case Ask():
                    incoming = self._from(sender, frame.life)
                    self._say(sender, incoming.answer(frame, time.monotonic()))
                case Note():
                    self._receiver.note(sender, frame.life, frame.kind, frame.header)
        except PayloadError as error:
            self._receiver.refuse(sender, error)

    def _on_chunk(self, chunk: Chunk, part: Body, shared: bool) -> None:
        if chunk.offset + len(part) > chunk.total:
            raise PayloadError(
                "length",
                f"{len(part)} bytes at {chunk.offset} of a message of {chunk.total}",
            )
        incoming, wanted, refused = self._from(chunk.agent, chunk.life), True, None
        if incoming.begins(chunk):
            wanted = chunk.kind != PROBING
            try:
                if wanted:
                    self._receiver.check(
                        chunk.agent, chunk.life, chunk.kind, chunk.header, chunk.total
                    )
            except PayloadError as error:
                wanted, refused = False, error
        ack, arrival = incoming.accept(chunk, part, time.monotonic(), wanted, shared)
        if ack is not None:
            self._say(chunk.agent, ack)
        if refused is not None:
            raise refused
        if arrival is None:
            self._receiver.progress(chunk.agent)
        elif arrival.body:
            self._receiver.receive(arrival)
        else:
            self._receiver.note(arrival.sender, arrival.life, arrival.kind, arrival.header)

    def _from(self, sender: str, life: str) -> Incoming:
        with self._lock:
            lives = self._incoming.setdefault(sender, {})
            if life not in lives:
                lives[life] = Incoming(self._agent, self._life, self._host)
                for old in list(lives)[:-LIVES]:
                    del lives[old]
            return lives[life]

    def _say(self, to: str, ack: Ack) -> None:
        self._transport.put(to, frames.encode(ack), b"", urgent=True)

    def __enter__(self) -> Self:
        return self

    def drain(self) -> None:
        """Wait until all has arrived, or nothing moves any more."""
        while True:
            with self._lock:
                links = list(self._links.values())
            if not any(link.moves() for link in links):
                return
            time.sleep(DRAIN_STEP)

    def __exit__(self, *error: object) -> None:
        self.drain()
        for neighbour in list(self._links):
            self.forget(neighbour)
        self._transport.close()


class _Link:
    """The sender to one neighbour: a thread that waits for window, route or something to say."""

    def __init__(
        self, transport: Transport, to: str, outgoing: Outgoing, shared: SharedMemory
    ) -> None:
        self._transport, self._to, self._shared = transport, to, shared
        self._out = outgoing
        self._news = threading.Condition()
        self._listens = self._closed = self._ask_now = self._silent = False
        self._undelivered = 0
        self._via_shared = False
        self._thread = threading.Thread(target=self._run, name=f"link to {to}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def offer(self, message: Message) -> None:
        with self._news:
            self._out.offer(message)
            self._news.notify()

    def route(self, listens: bool) -> None:
        """The neighbour listens from now on, or no longer does."""
        with self._news:
            self._listens = listens
            if listens and not self._out.window.rate and not self._out.under_way:
                self._out.waiting = {
                    (PROBING, 0): Message(PROBING, b"", bytes(PROBE)),
                    **self._out.waiting,
                }
            self._ask_now = listens
            self._news.notify()

    def busy(self) -> bool:
        """Whether anything has not arrived."""
        with self._news:
            return bool(self._out.waiting or self._out.under_way)

    def moves(self) -> bool:
        """Whether something is under way and still arrives."""
        with self._news:
            patience = END + 2 * self._out.window.round_trip
            return bool(self._out.under_way) and time.monotonic() < self._out.progress + patience

    def acknowledge(self, ack: Ack) -> bool:
        """Learn what has arrived; whether that is news."""
        now = time.monotonic()
        with self._news:
            before = self._out.resumes
            self._out.acknowledge(ack, now)
            self._via_shared = ack.shared
            if self._silent and self._out.progress == now:
                self._silent = False
                log.info("link to %s moves again", self._to)
            if self._out.resumes > before:
                log.info(
                    "link to %s was lost: goes on behind %.2f MB, %.2f MB sent again so far",
                    self._to, ack.have / 1e6, self._out.resent / 1e6,
                )  # fmt: skip
            self._news.notify()
            return self._out.progress == now

    def progress(self) -> float:
        return self._out.progress

    def report(self, moved: float) -> LinkReport:
        now = time.monotonic()
        with self._news:
            out = self._out
            return LinkReport(
                rate=8 * out.window.rate or None,
                latency=out.window.round_trip / 2 or None,
                window=out.window.size,
                backlog=out.backlog,
                age=now - moved if moved else None,
                delivered=out.delivered,
                replaced=out.replaced,
                resumes=out.resumes,
                resent=out.resent,
                undelivered=self._undelivered,
                shared=self._via_shared,
            )

    def close(self) -> None:
        with self._news:
            self._closed = True
            left = len(self._out.under_way) + len(self._out.waiting)
            self._undelivered += left
            if left:
                log.info("link to %s: %s", self._to, self._state())
            self._news.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join(END)

    def _state(self) -> str:
        rate = self._out.window.rate
        known = f"{8e-6 * rate:.3g} Mbit/s" if rate else "rate unknown"
        return f"{self._out.backlog / 1e6:.2f} MB not acknowledged, {known}"

    def _run(self) -> None:
        self._transport.reach(self._to)
        while True:
            with self._news:
                if self._closed:
                    return
                now = time.monotonic()
                if self._listens and (part := self._out.chunk(now)) is not None:
                    ask = None
                elif (ask := self._question(now)) is None:
                    self._news.wait(self._patience(now))
                    continue
            if ask is not None:
                self._transport.put(self._to, frames.encode(ask), b"", urgent=False)
            elif part is not None:
                self._put(part)

    def _question(self, now: float) -> Ask | None:
        ask = self._out.ask(now, self._ask_now)
        self._ask_now = False
        idle = now - self._out.progress
        if ask is not None and idle > SILENT and not self._silent:
            self._silent = True
            log.warning("link to %s: nothing moves for %.1f s; %s", self._to, idle, self._state())
        return ask

    def _patience(self, now: float) -> float | None:
        """How long to wait for news [s]; None: for ever, for nothing is under way."""
        return max(0.0, self._out.due(now)) if self._out.under_way else None

    def _put(self, part: Part) -> None:
        data: Body | zenoh.ZBytes = part.body
        if part.shared:
            try:
                data = self._shared.wrap(part.body)
            except zenoh.ZError as error:
                log.info("%d bytes without shared memory (%s)", part.size, error)
                with self._news:
                    self._out.share_no_more()
        elif part.size < len(part.body):
            start = part.frame.offset
            data = bytes(memoryview(part.body)[start : start + part.size])
        self._transport.put(self._to, frames.encode(part.frame), data, urgent=False)
