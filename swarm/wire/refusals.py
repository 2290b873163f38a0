"""Who is on the network but means something else, and is therefore left out.

Beside its presence an agent announces what its parameters mean: protocol, layout and everything
that agents must agree on (:class:`swarm.wire.payload.Layout`).  One of the same swarm with another
meaning is refused: nobody waits for it, each side says in one line what differs, and who comes to a
swarm that speaks otherwise does not join it. Agents of another swarm are told of once and otherwise
none of our business.
"""

import base64
import binascii
import logging
import zlib
from typing import Self

import msgspec
import zenoh

from swarm.errors import NetworkError, PayloadError
from swarm.protocol.messages import PROTOCOL
from swarm.wire.keys import SHOWN, Keys
from swarm.wire.payload import Layout

log = logging.getLogger(__name__)
LOOK = 2.0  # [s] at most for those who are here to say what they speak
LINES = 64  # told at most, about different agents and swarms
HEARD = 1024  # meanings kept at most; whoever can declare tokens can declare many
LONGEST = 65_536  # [bytes] of what an agent says that it means
DIFFERENCES = 4  # named at most


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
        try:
            swarm, agent = Keys.identity(key := str(sample.key_expr))
        except PayloadError:
            return  # nobody's token
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
            if not self._heard.get(agent, {said}):
                del self._heard[agent]
        elif sum(map(len, self._heard.values())) < HEARD:
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
            if reply.ok is None:
                continue
            try:
                agent = Keys.identity(key := str(reply.ok.key_expr))[1]
            except PayloadError:
                continue
            heard[agent] = key.rsplit("/", 1)[-1]
        heard.pop(self._agent, None)
        if heard and self._speaks not in heard.values():
            raise NetworkError(f'swarm "{self._keys.swarm}" refuses us: {self._difference(heard)}')

    def _difference(self, heard: dict[str, str]) -> str:
        each = "; ".join(f"{agent} {differs(said, self._speaks)}" for agent, said in heard.items())
        return f"{each}: expected the same release and the same swarm file everywhere"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if not self._session.is_closed():
            self._token.undeclare()
            self._subscriber.undeclare()


def speech(layout: Layout) -> str:
    """Protocol, layout and all that must agree, as the last part of a key."""
    parts = repr(layout.parts)
    shown = parts if len(parts) <= SHOWN else f"#{layout.shape}"
    vectors = [("layout", shown), ("fingerprint", layout.fingerprint)]
    packed = zlib.compress(msgspec.msgpack.encode([*vectors, *layout.agreed]))
    return f"{PROTOCOL}.{base64.urlsafe_b64encode(packed).decode().rstrip('=')}"


def differs(theirs: str, ours: str) -> str:
    """In what two speeches differ, in words."""
    their_protocol, _, their_text = theirs.partition(".")
    our_protocol, _, our_text = ours.partition(".")
    if their_protocol != our_protocol:
        return f"speaks protocol {their_protocol[:8]}, we {our_protocol}"
    there, here = _meaning(their_text), _meaning(our_text)
    wrong = [
        f"{key} = {there.get(key, 'missing')}, we {here.get(key, 'missing')}"
        for key in sorted(here.keys() | there.keys())
        if key != "fingerprint" and there.get(key) != here.get(key)
    ]
    named = "; ".join(wrong[:DIFFERENCES]) or "what its parameters mean"
    more = f"; and {len(wrong) - DIFFERENCES} more" if len(wrong) > DIFFERENCES else ""
    return f"differs in {named}{more}"


def _meaning(text: str) -> dict[str, str]:
    try:
        packed = base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))
        plain = zlib.decompressobj().decompress(packed, LONGEST)
        pairs = msgspec.msgpack.decode(plain, type=list[tuple[str, str]])
    except (binascii.Error, ValueError, zlib.error):
        return {}
    return {key[:SHOWN]: value[:SHOWN] for key, value in pairs}
