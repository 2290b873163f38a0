"""Who is on the network but means something else, and is therefore left out.

Beside its presence an agent announces what its parameters mean: protocol and layout
(:mod:`swarm.wire.payload`).  One of the same swarm with another meaning is refused: nobody waits
for it, each side says so in one line, and who comes to a swarm that speaks otherwise does not join
it. Agents of another swarm are told of once and otherwise none of our business.
"""

import logging
from typing import Self

import zenoh

from swarm.errors import NetworkError
from swarm.wire.keys import Keys
from swarm.wire.payload import PROTOCOL, Layout

log = logging.getLogger(__name__)
LOOK = 2.0  # [s] at most for those who are here to say what they speak
LINES = 64  # told at most, about different agents and swarms


class Refusals:
    """Watches what everybody speaks; a context manager.

    Args:
        session: an open session.
        keys: the swarm's keys.
        agent: own id.
        layout: what the own parameters mean.
    """

    def __init__(self, session: zenoh.Session, keys: Keys, agent: str, layout: Layout) -> None:
        self._session, self._keys, self._agent = session, keys, agent
        self._speaks = speech(layout)
        self._heard: dict[str, set[str]] = {}  # by id; impostors must not shut out the real one
        self._told: set[str] = set()
        self._subscriber = session.liveliness().declare_subscriber(
            Keys("*").speaks(), self._on_token, history=True
        )
        self._token = session.liveliness().declare_token(keys.speaks(agent, self._speaks))

    def refused(self) -> set[str]:
        """Ids of this swarm whose every owner speaks otherwise."""
        heard = [(agent, tuple(said)) for agent, said in list(self._heard.items())]
        return {agent for agent, said in heard if said and self._speaks not in said}

    def _on_token(self, sample: zenoh.Sample) -> None:
        swarm, agent = Keys.identity(key := str(sample.key_expr))
        said, here = key.rsplit("/", 1)[-1], sample.kind == zenoh.SampleKind.PUT
        if swarm != self._keys.swarm:
            if here:
                ours = self._keys.swarm
                self._tell(
                    f"{swarm}/",
                    f'another swarm is on this network, "{swarm}" ({agent}): '
                    f'nothing of it is mixed into "{ours}"',
                )
        elif not here:
            self._heard.get(agent, set()).discard(said)
        else:
            self._heard.setdefault(agent, set()).add(said)
            if said != self._speaks:
                self._tell(agent, f"refused: {self._difference({agent: said})}")

    def _tell(self, about: str, line: str) -> None:
        """Log a line, the first about somebody, and no flood of them."""
        if about not in self._told and len(self._told) < LINES:
            self._told.add(about)
            log.warning("%s", line)

    def check(self) -> None:
        """See that somebody here speaks as we do, if anybody is here.

        Raises:
            NetworkError: all who are here speak otherwise.
        """
        heard: dict[str, str] = {}
        for reply in self._session.liveliness().get(self._keys.speaks(), timeout=LOOK):
            if reply.ok is not None:
                key = str(reply.ok.key_expr)
                heard[Keys.identity(key)[1]] = key.rsplit("/", 1)[-1]
        heard.pop(self._agent, None)
        if heard and self._speaks not in heard.values():
            raise NetworkError(f'swarm "{self._keys.swarm}" refuses us: {self._difference(heard)}')

    def _difference(self, heard: dict[str, str]) -> str:
        theirs = "; ".join(f"{agent} speaks {_words(said)}" for agent, said in heard.items())
        return (
            f"{theirs}, we {_words(self._speaks)}: expected the same release, and the same name, "
            "policy, tasks' spaces and mixing in all swarm files"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if not self._session.is_closed():
            self._token.undeclare()
            self._subscriber.undeclare()


def speech(layout: Layout) -> str:
    """Protocol and layout as the last part of a key."""
    return f"{PROTOCOL}.{layout.fingerprint}"


def _words(said: str) -> str:
    protocol, _, fingerprint = said.partition(".")
    return f"protocol {protocol}, layout {fingerprint}"
