"""What carries frames: Zenoh between processes, or nothing but calls within one.

A :class:`Transport` delivers what one agent puts for another in order, or not at all; ``urgent``
frames overtake the others, and are dropped rather than waited for.  Large parts belong to the
sender of one neighbour alone: ``put`` may block it, and nobody else, while the link is full.
"""

import threading
from collections.abc import Callable
from contextlib import ExitStack
from typing import Protocol, Self

import zenoh

from swarm.errors import PayloadError
from swarm.wire.buffers import Body
from swarm.wire.keys import Keys
from swarm.wire.shared import unwrap

Receive = Callable[[str, bytes, Body, bool], None]  # sender, frame, part, whether shared memory
Changed = Callable[[str, bool], None]  # neighbour, whether it listens


class Transport(Protocol):
    """One agent's way to the others; a context manager that listens while it is open."""

    def open(self, receive: Receive, changed: Changed) -> None:
        """Listen; both are called on other threads and must not block."""
        ...

    def reach(self, to: str) -> None:
        """Say from now on when ``to`` listens and when it no longer does."""
        ...

    def put(self, to: str, frame: bytes, part: Body | zenoh.ZBytes, urgent: bool) -> None:
        """Send a frame and its part."""
        ...

    def close(self) -> None:
        """Listen and send no more."""
        ...


class ZenohTransport:
    """Frames as attachments, parts as payloads, a key for each pair.

    Args:
        session: an open session.
        keys: the swarm's keys.
        agent: own id.
        refuse: told of senders and what is wrong with their keys.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        agent: str,
        refuse: Callable[[str, PayloadError], None],
    ) -> None:
        self._session, self._keys, self._agent, self._refuse = session, keys, agent, refuse
        self._publishers: dict[tuple[str, bool], zenoh.Publisher] = {}
        self._lock = threading.Lock()
        self._resources = ExitStack()
        self._changed: Changed = lambda _neighbour, _listens: None

    def open(self, receive: Receive, changed: Changed) -> None:
        def on_sample(sample: zenoh.Sample) -> None:
            try:
                _, sender = Keys.identity(key := str(sample.key_expr))
            except PayloadError as error:
                self._refuse(key, error)
                return
            attachment = sample.attachment
            part, shared = unwrap(sample.payload) if sample.payload else (b"", False)
            receive(sender, b"" if attachment is None else attachment.to_bytes(), part, shared)

        self._changed = changed
        subscriber = self._session.declare_subscriber(
            self._keys.params(receiver=self._agent), on_sample
        )
        self._resources.callback(subscriber.undeclare)

    def reach(self, to: str) -> None:
        publisher = self._publisher(to, urgent=False)
        changed = self._changed
        listener = publisher.declare_matching_listener(lambda status: changed(to, status.matching))
        self._resources.callback(listener.undeclare)
        if publisher.matching_status.matching:  # type: ignore[attr-defined]  # not a bool
            changed(to, True)

    def put(self, to: str, frame: bytes, part: Body | zenoh.ZBytes, urgent: bool) -> None:
        self._publisher(to, urgent).put(part, attachment=frame)

    def _publisher(self, to: str, urgent: bool) -> zenoh.Publisher:
        with self._lock:
            if (to, urgent) not in self._publishers:
                publisher = self._session.declare_publisher(
                    self._keys.params(self._agent, to),
                    congestion_control=(
                        zenoh.CongestionControl.DROP if urgent else zenoh.CongestionControl.BLOCK
                    ),
                    priority=(zenoh.Priority.INTERACTIVE_HIGH if urgent else zenoh.Priority.DATA),
                    express=urgent,
                )
                self._publishers[to, urgent] = publisher
            return self._publishers[to, urgent]

    def close(self) -> None:
        if not self._session.is_closed():
            self._resources.close()  # publishers end with the session: one may still be in use

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class MemoryTransport:
    """The same within one process, for as many agents as share the ``network``.

    Args:
        network: agent -> its transport; one dictionary for all.
        agent: own id.
    """

    def __init__(self, network: "dict[str, MemoryTransport]", agent: str) -> None:
        self._network, self._agent = network, agent
        self._receive: Receive | None = None
        self._changed: Changed | None = None

    def open(self, receive: Receive, changed: Changed) -> None:
        self._receive, self._changed = receive, changed
        self._network[self._agent] = self
        self._tell(True)

    def reach(self, to: str) -> None:
        if to in self._network and self._changed is not None:
            self._changed(to, True)

    def put(self, to: str, frame: bytes, part: Body | zenoh.ZBytes, urgent: bool) -> None:
        other = self._network.get(to)
        if other is not None and other._receive is not None:
            data = part.to_bytes() if isinstance(part, zenoh.ZBytes) else part
            other._receive(self._agent, frame, data, False)

    def close(self) -> None:
        if self._network.get(self._agent) is self:
            del self._network[self._agent]
            self._tell(False)

    def _tell(self, listens: bool) -> None:
        for name, other in list(self._network.items()):
            if name != self._agent and other._changed is not None:
                other._changed(self._agent, listens)
