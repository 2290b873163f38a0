"""Parameters that go out: one publisher a neighbour, one message for all of them."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Self

import zenoh

from swarm.mixing.compression import Body
from swarm.wire.keys import Keys
from swarm.wire.parcels import Parcels
from swarm.wire.payload import PROTOCOL, Layout, ParameterHeader, encode_header

Used = Mapping[int, Mapping[str, float]]


class Dispatch:
    """One agent's outgoing parameters; a context manager that ends its publishers.

    Args:
        session: an open session.
        keys: the swarm's keys.
        me: own id and incarnation.
        layout: what the vectors mean.
        waits: whether a slow neighbour may hold this agent up, rather than miss a message.
        shared_memory: whether large bodies may go through /dev/shm.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        me: tuple[str, str],
        layout: Layout,
        waits: bool,
        shared_memory: bool,
    ) -> None:
        self._session, self._keys, self._layout = session, keys, layout
        self._agent, self._incarnation = me
        self._parcels = Parcels(shared_memory)
        self._header, self._body = b"", zenoh.ZBytes(b"")
        self._congestion = zenoh.CongestionControl.BLOCK if waits else zenoh.CongestionControl.DROP
        self._publishers: dict[str, zenoh.Publisher] = {}

    def prepare(
        self, round_: int, neighbours: tuple[str, ...], body: Body, used: Used, learned: float
    ) -> None:
        """Make the message of a round; see :meth:`swarm.exchange.Exchange.publish`."""
        header = self.sign(self._layout, round_, neighbours, used, learned)
        self._header, self._body = encode_header(header), self._parcels.wrap(body)

    def send(self, neighbours: Iterable[str]) -> None:
        """Send the message; returns as soon as Zenoh has queued it."""
        for neighbour in neighbours:
            self.publisher(neighbour).put(self._body, attachment=self._header)

    def beat(self, neighbours: Iterable[str]) -> None:
        """Send its header alone: a sign of life, and of whom this agent exchanges with."""
        for neighbour in neighbours:
            self.publisher(neighbour).put(b"", attachment=self._header)

    def publisher(self, neighbour: str) -> zenoh.Publisher:
        """Where a neighbour listens to this agent."""
        if neighbour not in self._publishers:
            self._publishers[neighbour] = self._session.declare_publisher(
                self._keys.params(self._agent, neighbour),
                congestion_control=self._congestion,
                priority=zenoh.Priority.DATA,
            )
        return self._publishers[neighbour]

    def sign(
        self,
        layout: Layout,
        round_: int,
        neighbours: tuple[str, ...],
        used: Used = MappingProxyType({}),
        learned: float = 0.0,
    ) -> ParameterHeader:
        """A header in this agent's name."""
        return ParameterHeader(
            version=PROTOCOL,
            fingerprint=layout.fingerprint,
            agent=self._agent,
            incarnation=self._incarnation,
            round=round_,
            neighbours=neighbours,
            used={past: dict(weights) for past, weights in used.items()},
            learned=learned,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if not self._session.is_closed():
            for publisher in self._publishers.values():
                publisher.undeclare()
