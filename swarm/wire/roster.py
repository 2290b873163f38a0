"""Who is here: liveliness tokens in, names and incarnations out.

An agent is present from the moment it declares its token until Zenoh withdraws it: at once when the
process ends in whatever way, after the lease when it freezes or is cut off.
"""

import logging
import threading
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from typing import Self

import zenoh

from swarm.errors import PayloadError
from swarm.protocol.messages import newest, order
from swarm.wire.keys import Keys

log = logging.getLogger(__name__)
LIVES = 16  # of one id, kept at most
LOOK = 1.0  # [s] at most for tokens that are asked for
TELL = (2.0, 30.0)  # [s] of waiting before the log says for whom; between the later lines


@dataclass(slots=True)
class Presence:
    """Pure bookkeeping of tokens: agent -> incarnations alive.

    Attributes:
        members: whose tokens count.
        alive: their incarnations.
    """

    members: Collection[str]
    alive: dict[str, list[str]] = field(default_factory=dict)

    def put(self, agent: str, incarnation: str) -> None:
        """A token appeared; the latest incarnation of an agent is the one that counts."""
        if agent not in self.members:
            return
        lives = self.alive.setdefault(agent, [])
        if incarnation not in lives and len(lives) < LIVES:
            lives.append(incarnation)

    def delete(self, agent: str, incarnation: str) -> None:
        """A token went away."""
        lives = self.alive.get(agent, [])
        if incarnation in lives:
            lives.remove(incarnation)
        if not lives:
            self.alive.pop(agent, None)

    def incarnation(self, agent: str) -> str | None:
        """The latest living incarnation of an agent."""
        return max(self.alive.get(agent, ()), key=order, default=None)


class Roster:
    """Watches the swarm's tokens; a context manager.

    Args:
        session: an open session.
        keys: the swarm's keys.
        members: of the swarm; others do not count.
        refused: ids that do not count as present (:mod:`swarm.wire.refusals`).
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        members: Collection[str],
        refused: Callable[[], Collection[str]] = tuple,
    ) -> None:
        self._session, self._keys, self._refused = session, keys, refused
        self._on_change: list[Callable[[], None]] = []
        self._presence = Presence(members)
        self._changed = threading.Condition()
        self._token: zenoh.LivelinessToken | None = None
        self._subscriber = session.liveliness().declare_subscriber(
            keys.alive(), self._on_token, history=True
        )

    def _on_token(self, sample: zenoh.Sample) -> None:
        try:
            agent, incarnation = Keys.token(str(sample.key_expr))
        except PayloadError:
            return  # nobody's token
        with self._changed:
            if sample.kind == zenoh.SampleKind.PUT:
                self._presence.put(agent, incarnation)
            else:
                self._presence.delete(agent, incarnation)
            self._changed.notify_all()
        for call in self._on_change:
            call()

    def call_on_change(self, call: Callable[[], None]) -> None:
        """Have ``call`` called after every change, on Zenoh's thread; it must not block."""
        self._on_change.append(call)

    def present(self) -> dict[str, str]:
        """Agents that are here, each with its latest incarnation."""
        refused = self._refused()
        with self._changed:
            alive = self._presence.alive.items()
            return {agent: newest(lives) for agent, lives in alive if agent not in refused}

    def incarnation(self, agent: str) -> str | None:
        """The latest living incarnation of an agent, None if it is not here."""
        with self._changed:
            return self._presence.incarnation(agent)

    def earlier(self, agent: str) -> list[str]:
        """Lives of an agent that are here already; asks the network, for tokens take their time."""
        key = self._keys.alive(agent)
        replies = self._session.liveliness().get(key, timeout=LOOK)
        tokens = (str(reply.ok.key_expr) for reply in replies if reply.ok is not None)
        return [Keys.token(token)[1] for token in tokens]

    def announce(self, agent: str, incarnation: str) -> None:
        """Be present, until the roster is closed."""
        key = self._keys.alive(agent, incarnation)
        self._token = self._session.liveliness().declare_token(key)

    def wait_for(
        self, agents: Iterable[str], deadline: float, stop: threading.Event | None = None
    ) -> set[str]:
        """Wait until all ``agents`` are present; return those that are not by the deadline [s]."""
        wanted = set(agents)
        end = time.monotonic() + deadline
        told, pause = time.monotonic(), TELL[0]
        with self._changed:
            while missing := wanted - (self._presence.alive.keys() - set(self._refused())):
                left = end - time.monotonic()
                if left <= 0 or (stop is not None and stop.is_set()):
                    return missing
                if time.monotonic() - told >= pause:
                    told, pause = time.monotonic(), TELL[1]
                    names = ", ".join(sorted(missing))
                    log.info("waiting for %s, %.0f s at most", names, left)
                self._changed.wait(min(left, 0.1))
        return set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._session.is_closed():
            return
        if self._token is not None:
            self._token.undeclare()
        self._subscriber.undeclare()
