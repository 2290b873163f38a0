"""Sockets: UDP towards companions and ground stations, or a TCP port that they connect to.

Interface: :class:`Link`, implemented by :class:`UdpLink` and :class:`TcpLink`.  Everything that is
sent goes to every peer, so that sequence numbers stay whole.  A link waits in the kernel, never
spins, and never raises because of a peer.
"""

import contextlib
import select
import socket
import time
from collections.abc import Hashable, Iterable
from typing import Protocol

from sim.vehicle.codec import Splitter

DATAGRAM = 1400  # bytes, fits an Ethernet frame
MOST_PEERS = 8
FORGET = 30.0  # s of silence after which a peer that came by itself is forgotten
RECEIVE = 65_536  # bytes

Address = tuple[str, int]
Received = list[tuple[Hashable, list[bytes]]]  # peer, frames


class Link(Protocol):
    """A way to the outside."""

    def receive(self, timeout: float) -> Received:
        """Frames, as soon as there are any; nothing after `timeout` seconds."""
        ...

    def welcome(self, peer: Hashable) -> None:
        """The peer has sent something valid: talk to it from now on."""
        ...

    def send(self, frames: Iterable[bytes]) -> None:
        """Send to all peers, in as few datagrams as possible."""
        ...

    def close(self) -> None:
        """Let go of the sockets."""
        ...


class UdpLink:
    """Sends to fixed targets and to whoever has sent something valid lately."""

    def __init__(self, local: Address, targets: Iterable[Address]) -> None:
        self._targets = tuple(targets)
        self._guests: dict[Address, float] = {}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(local)
        except OSError:
            self._socket.close()
            raise
        self.port: int = self._socket.getsockname()[1]

    def receive(self, timeout: float) -> Received:
        received: Received = []
        self._socket.settimeout(max(timeout, 0.0))
        while True:
            try:
                data, peer = self._socket.recvfrom(RECEIVE)
            except (TimeoutError, BlockingIOError, InterruptedError):
                return received
            except OSError:  # a peer's port is closed
                return received
            received.append((peer, list(Splitter().feed(data))))
            self._socket.settimeout(0.0)
            if len(received) >= 64:  # let others have their turn
                return received

    def welcome(self, peer: Hashable) -> None:
        if peer in self._targets or not isinstance(peer, tuple):
            return
        now = time.monotonic()
        self._guests = {p: heard for p, heard in self._guests.items() if now - heard < FORGET}
        if peer in self._guests or len(self._guests) < MOST_PEERS:
            self._guests[peer] = now

    def send(self, frames: Iterable[bytes]) -> None:
        for datagram in batches(frames):
            for peer in (*self._targets, *self._guests):
                with contextlib.suppress(OSError):  # nobody there, or no route: not our concern
                    self._socket.sendto(datagram, peer)

    def close(self) -> None:
        self._socket.close()


class TcpLink:
    """Listens; every client is a peer."""

    def __init__(self, local: Address) -> None:
        self._server = socket.create_server(local)
        self._server.setblocking(False)
        self.port: int = self._server.getsockname()[1]
        self._clients: dict[socket.socket, Splitter] = {}

    def receive(self, timeout: float) -> Received:
        try:
            ready, _, _ = select.select([self._server, *self._clients], [], [], max(timeout, 0.0))
        except InterruptedError:
            return []
        received: Received = []
        for sock in ready:
            if sock is self._server:
                self._admit()
                continue
            try:
                data = sock.recv(RECEIVE)
            except OSError:
                data = b""
            if data:
                received.append((sock, list(self._clients[sock].feed(data))))
            else:
                self._dismiss(sock)
        return received

    def welcome(self, peer: Hashable) -> None:
        """Clients are peers from the beginning."""

    def send(self, frames: Iterable[bytes]) -> None:
        for data in batches(frames):
            for client in list(self._clients):
                try:
                    client.sendall(data)
                except OSError:  # gone, or it does not read
                    self._dismiss(client)

    def close(self) -> None:
        for client in list(self._clients):
            self._dismiss(client)
        self._server.close()

    def _admit(self) -> None:
        with contextlib.suppress(OSError):
            client, _ = self._server.accept()
            if len(self._clients) >= MOST_PEERS:
                client.close()
                return
            client.settimeout(0.1)  # s; who does not read for that long is dismissed
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients[client] = Splitter()

    def _dismiss(self, client: socket.socket) -> None:
        del self._clients[client]
        client.close()


def batches(frames: Iterable[bytes]) -> list[bytes]:
    """Frames joined into datagrams."""
    joined: list[bytes] = []
    batch: list[bytes] = []
    size = 0
    for frame in frames:
        if size + len(frame) > DATAGRAM and batch:
            joined.append(b"".join(batch))
            batch, size = [], 0
        batch.append(frame)
        size += len(frame)
    if batch:
        joined.append(b"".join(batch))
    return joined
