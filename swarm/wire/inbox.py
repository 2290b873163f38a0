"""Between Zenoh's threads and the agent's: what comes in goes straight to the protocol.

The protocol (:mod:`swarm.protocol.machine`) has no threads; whoever touches it holds
:attr:`Inbox.lock`.  It keeps the two newest vectors of each member, so nothing piles up here.
"""

import threading
import time
from collections.abc import Iterator

from swarm.protocol.machine import Machine
from swarm.protocol.messages import ParameterHeader
from swarm.protocol.peers import Delivery
from swarm.wire.payload import Message


class Inbox:
    """Hands messages to the protocol and wakes the agent, for one reader and many writers.

    Attributes:
        machine: the protocol.
        lock: of the protocol.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.lock = threading.Condition()
        self._count = 0

    def store(self, message: Message) -> None:
        """A vector has come."""
        with self.lock:
            self.machine.heard(time.monotonic(), message.header, message.vector)
            self._notify()

    def touch(self, header: ParameterHeader) -> None:
        """A header has come alone: a sign of life."""
        with self.lock:
            self.machine.heard(time.monotonic(), header, None)
            self._notify()

    def progress(self, agent: str) -> None:
        """Part of something of a member's has come: no time limit runs out on it."""
        with self.lock:
            self.machine.progress(time.monotonic(), agent)

    def lacks(self, header: ParameterHeader) -> bool:
        """Whether the vector of a header that came alone is missing, and still of use."""
        with self.lock:
            machine, peer = self.machine, self.machine.peers[header.agent]
            wanted = machine.agent in header.neighbours and header.round >= machine.round
            return wanted and header.round not in peer.vectors

    def everything(self) -> list[Message]:
        """All vectors that are kept."""
        with self.lock:
            return [Message(kept.header, kept.vector) for kept in self._kept()]

    def _kept(self) -> Iterator[Delivery]:
        for peer in self.machine.peers.values():
            yield from peer.vectors.values()

    def forget(self, message: Message) -> None:
        """Drop a vector."""
        with self.lock:
            peer = self.machine.peers[message.header.agent]
            peer.vectors.pop(message.header.round, None)

    def wake(self) -> None:
        """Wake the reader for another reason."""
        with self.lock:
            self._notify()

    def _notify(self) -> None:
        self._count += 1
        self.lock.notify_all()

    @property
    def count(self) -> int:
        """Grows with everything that happens."""
        return self._count

    def wait(self, seen: int, timeout: float) -> None:
        """Wait for anything that came after :meth:`count` was ``seen``, at most ``timeout`` [s]."""
        with self.lock:
            if self._count == seen:
                self.lock.wait(timeout)

    def ages(self) -> dict[str, tuple[int, float]]:
        """Newest round of each sender and the age of its last sign of life [s], of one moment."""
        with self.lock:
            now = time.monotonic()
            peers = self.machine.peers.items()
            return {m: (peer.round, now - peer.heard) for m, peer in peers if peer.view is not None}
