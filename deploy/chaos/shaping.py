"""A proxy that makes of a connection on loopback a link of some rate, latency and mishaps.

:func:`shaped` listens, dials the target for every connection, and passes bytes on as a radio
would: an exact token bucket in each direction (a byte leaves when those before it have, at so many
bits a second), then so much time on the way; the buffers in front of it are small.  For kernels
without netem.  Interface: :class:`Shape`, :func:`shaped`.
"""

import random
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

PIECE = 65_536  # [bytes] read at once, at most
QUANTUM = 0.005  # [s] of the link that are read at once, at most
CREDIT = 0.5  # [s] by which a thread may be late without the link losing what it could have sent
DEPTH = 0.05  # [s] of the link that wait in front of it, so that a late thread leaves it no gap
BUFFER = 65_536  # [bytes] of the sockets in front of the link


@dataclass(frozen=True, slots=True)
class Shape:
    """What a link is like, in each direction.

    Attributes:
        rate: [bit/s]; 0: as fast as it goes.
        latency: one way [s].
        resets: chance for a connection to be reset in any one second.
        seed: of the resets.
    """

    rate: float
    latency: float = 0.0
    resets: float = 0.0
    seed: int = 0


class Shaper:
    """A link that is shaped; :meth:`reset` breaks its connections, which may be made again."""

    def __init__(self, listen: int, target: int, shape: Shape) -> None:
        self._target, self._shape = target, shape
        self._dice = random.Random(shape.seed)
        self._open: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self.resets = 0
        self._server = socket.create_server(("127.0.0.1", listen))
        _start(self._accept)
        if shape.resets:
            _start(self._fail)

    def reset(self) -> None:
        """Break all connections; what is on the way is lost."""
        with self._lock:
            broken, self._open = self._open, set()
        self.resets += bool(broken)
        for end in broken:
            _reset(end)

    def close(self) -> None:
        """End everything."""
        self._closed.set()
        with suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self.reset()

    def _fail(self) -> None:
        while not self._closed.wait(0.1):
            if self._dice.random() < 0.1 * self._shape.resets:
                self.reset()

    def _accept(self) -> None:
        while not self._closed.is_set():
            try:
                near, _ = self._server.accept()
            except OSError:
                return
            far = socket.socket()
            try:
                for end in (near, far):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    if self._shape.rate:
                        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
                far.connect(("127.0.0.1", self._target))
            except OSError:
                near.close()
                continue
            with self._lock:
                self._open |= {near, far}
            for source, sink in ((near, far), (far, near)):
                _Direction(self, source, sink, self._shape)

    def part(self, *ends: socket.socket) -> None:
        """A connection is over."""
        with self._lock:
            self._open -= set(ends)
        for end in ends:
            _reset(end)


class _Direction:
    """One direction of a connection: a thread that reads at the rate, one that writes later."""

    def __init__(self, shaper: Shaper, source: socket.socket, sink: socket.socket, shape: Shape):
        self._shaper, self._source, self._sink, self._shape = shaper, source, sink, shape
        self._way: deque[tuple[float, bytes]] = deque()
        self._news = threading.Condition()
        _start(self._read)
        _start(self._write)

    def _read(self) -> None:
        rate, free = self._shape.rate / 8, time.monotonic()  # bytes/s; when the link is free [s]
        piece = PIECE if not rate else int(min(PIECE, max(1500, rate * QUANTUM)))
        full = (
            False  # whether the sender waits for the link, so that a late thread costs it nothing
        )
        while True:
            if rate and (ahead := free - time.monotonic()) > DEPTH:
                time.sleep(ahead - DEPTH / 2)
            try:
                data = self._source.recv(piece)
            except OSError:
                data = b""
            now = time.monotonic()
            free = max(now - CREDIT * full, free) + (len(data) / rate if rate else 0.0)
            full = len(data) == piece
            with self._news:
                self._way.append((free + self._shape.latency, data))
                self._news.notify()
            if not data:
                return

    def _write(self) -> None:
        while True:
            with self._news:
                while not self._way:
                    self._news.wait()
                at, data = self._way.popleft()
            if (early := at - time.monotonic()) > 0:
                time.sleep(early)
            try:
                if not data:
                    raise ConnectionError
                self._sink.sendall(data)
            except OSError:
                self._shaper.part(self._source, self._sink)
                return


def _start(target: Callable[[], None]) -> None:
    threading.Thread(target=target, daemon=True).start()


def _reset(end: socket.socket) -> None:
    """Close so that both sides see a reset, threads that wait in it included."""
    with suppress(OSError):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    with suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()


@contextmanager
def shaped(listen: int, target: int, shape: Shape) -> Iterator[Shaper]:
    """Whoever connects to port ``listen`` reaches port ``target`` over such a link."""
    shaper = Shaper(listen, target, shape)
    try:
        yield shaper
    finally:
        shaper.close()
