"""Parameters that go out: one publisher a neighbour, one message for all of them."""

from collections.abc import Iterable
from typing import Self

import zenoh

from swarm.mixing.compression import Body
from swarm.protocol.messages import ParameterHeader
from swarm.wire.keys import Keys
from swarm.wire.parcels import Parcels
from swarm.wire.payload import encode_header


class Dispatch:
    """One agent's outgoing parameters; a context manager that ends its publishers.

    Args:
        session: an open session.
        keys: the swarm's keys.
        agent: own id.
        waits: whether a slow neighbour may hold this agent up, rather than miss a message.
        shared_memory: whether large bodies may go through /dev/shm.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        agent: str,
        waits: bool,
        shared_memory: bool,
    ) -> None:
        self._session, self._keys, self._agent = session, keys, agent
        self._parcels = Parcels(shared_memory)
        self._header, self._body = b"", zenoh.ZBytes(b"")
        self._congestion = zenoh.CongestionControl.BLOCK if waits else zenoh.CongestionControl.DROP
        self._publishers: dict[str, zenoh.Publisher] = {}

    def prepare(self, header: ParameterHeader, body: Body) -> None:
        """Make the message of a round; see :meth:`swarm.exchange.Exchange.publish`."""
        self._header, self._body = encode_header(header), self._parcels.wrap(body)

    def send(self, neighbours: Iterable[str]) -> None:
        """Send the message; returns as soon as Zenoh has queued it."""
        for neighbour in neighbours:
            self.publisher(neighbour).put(self._body, attachment=self._header)

    def beat(self, agents: Iterable[str], header: ParameterHeader) -> None:
        """Send a header alone: a sign of life, and of whom this agent exchanges with."""
        attachment = encode_header(header)
        for agent in agents:
            self.publisher(agent).put(b"", attachment=attachment)

    def publisher(self, neighbour: str) -> zenoh.Publisher:
        """Where a neighbour listens to this agent."""
        if neighbour not in self._publishers:
            self._publishers[neighbour] = self._session.declare_publisher(
                self._keys.params(self._agent, neighbour),
                congestion_control=self._congestion,
                priority=zenoh.Priority.DATA,
            )
        return self._publishers[neighbour]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if not self._session.is_closed():
            for publisher in self._publishers.values():
                publisher.undeclare()
