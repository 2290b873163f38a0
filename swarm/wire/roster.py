"""Who is here: liveliness tokens in, names and incarnations out.

An agent is present from the moment it declares its token until Zenoh withdraws it: at once when the
process ends in whatever way, after the lease when it freezes or is cut off.
"""

import threading
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from typing import Self

import zenoh

from swarm.errors import NetworkError, PayloadError
from swarm.wire.keys import Keys


@dataclass(slots=True)
class Presence:
    """Pure bookkeeping of tokens: agent -> incarnations alive, in order of arrival."""

    alive: dict[str, list[str]] = field(default_factory=dict)

    def put(self, agent: str, incarnation: str) -> None:
        """A token appeared; the newest incarnation of an agent is the one that counts."""
        lives = self.alive.setdefault(agent, [])
        if incarnation not in lives:
            lives.append(incarnation)

    def delete(self, agent: str, incarnation: str) -> None:
        """A token went away."""
        lives = self.alive.get(agent, [])
        if incarnation in lives:
            lives.remove(incarnation)
        if not lives:
            self.alive.pop(agent, None)

    def incarnation(self, agent: str) -> str | None:
        """The newest living incarnation of an agent."""
        lives = self.alive.get(agent)
        return lives[-1] if lives else None


class Roster:
    """Watches the swarm's tokens; a context manager.

    Args:
        session: an open session.
        keys: the swarm's keys.
        refused: ids that do not count as present (:mod:`swarm.wire.refusals`).
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        refused: Callable[[], Collection[str]] = tuple,
    ) -> None:
        self._session, self._keys, self._refused = session, keys, refused
        self._on_change: list[Callable[[], None]] = []
        self._presence = Presence()
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
        """Agents that are here, each with its newest incarnation."""
        refused = self._refused()
        with self._changed:
            alive = self._presence.alive.items()
            return {agent: lives[-1] for agent, lives in alive if agent not in refused}

    def incarnation(self, agent: str) -> str | None:
        """The newest living incarnation of an agent, None if it is not here."""
        with self._changed:
            return self._presence.incarnation(agent)

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
        with self._changed:
            while missing := wanted - (self._presence.alive.keys() - set(self._refused())):
                left = end - time.monotonic()
                if left <= 0 or (stop is not None and stop.is_set()):
                    return missing
                self._changed.wait(min(left, 0.1))
        return set()

    def wait_until_free(self, agent: str, deadline: float) -> None:
        """Wait until nobody lives under this id; the token of a frozen predecessor takes a lease.

        Raises:
            NetworkError: the id is still taken at the deadline [s].
        """
        end = time.monotonic() + deadline
        with self._changed:
            while (other := self._presence.incarnation(agent)) is not None:
                left = end - time.monotonic()
                if left <= 0:
                    raise NetworkError(
                        f'agent id "{agent}" is taken in swarm "{self._keys.swarm}" by incarnation '
                        f"{other}: expected an id that nobody else uses"
                    )
                self._changed.wait(left)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._session.is_closed():
            return
        if self._token is not None:
            self._token.undeclare()
        self._subscriber.undeclare()
