"""Parameters that come in: checked on the links' thread, kept for the rounds or refused.

A message counts when its header reads, names the sender that its key names, another member of the
swarm in its present life, and when its body is finite and not absurdly long.
"""

import math
from collections.abc import Callable, Collection

from swarm.errors import PayloadError
from swarm.mixing.compression import Codec, Plain
from swarm.protocol.guard import Guard
from swarm.protocol.messages import ParameterHeader, order
from swarm.wire.dispatch import BEAT, JOIN, ROUND, SENT, STATE, WANT
from swarm.wire.inbox import Inbox
from swarm.wire.payload import (
    Layout,
    Message,
    check_norm,
    decode_body,
    decode_header,
    plain,
)
from swarm.wire.roster import Roster
from swarm.wire.stream import Arrival

KINDS = (ROUND, STATE, BEAT, SENT, WANT, JOIN)
SPARE = 4096  # [bytes] that an encoding may add
NORM_FACTOR = 100.0  # times the own norm, or 1, is as large as a neighbour's may be


class Reception:
    """One agent's incoming parameters: the receiver of its links.

    Args:
        agent: own id.
        members: every id of the swarm file; others are strangers.
        layout: what the vectors mean.
        codec: their encoding.
        roster: who is present, and in which life.
        inbox: takes what is accepted.
        last: number of the swarm's last round; who claims a later one lies.
        most: what can be learned in it [rounds]; who claims more lies.

    Attributes:
        inbox: takes what is accepted.
        guard: who was refused, and why.
        on_state, on_note: told of a state that has come, and of notes that are no signs of life.
    """

    def __init__(
        self,
        agent: str,
        members: Collection[str],
        layout: Layout,
        codec: Codec,
        roster: Roster,
        inbox: Inbox,
        last: float,
        most: float,
    ) -> None:
        self.inbox, self.guard = inbox, Guard(members)
        self._agent, self._members = agent, members
        self._layout, self._codec, self._roster = layout, codec, roster
        self._last, self._most = last, most
        self._longest = math.inf  # norm of a neighbour's parameters; not known before the own
        self.on_state: Callable[[Message], None] = lambda _message: None
        self.on_note: Callable[[str, ParameterHeader], None] = lambda _kind, _header: None
        roster.call_on_change(self.inbox.wake)

    def measure_by(self, norm: float) -> None:
        """Hold all that comes, and what has come before, against the own vector's norm."""
        first, self._longest = math.isinf(self._longest), NORM_FACTOR * max(norm, 1.0)
        if not first:
            return
        for message in self.inbox.everything():
            try:
                check_norm(message.vector, self._longest)
            except PayloadError as error:
                self.inbox.forget(message)
                self.guard.reject(message.header.agent, error)

    def read_header(self, raw: bytes | None, layout: Layout) -> ParameterHeader:
        """The header of a message or an answer.

        Raises:
            PayloadError: it does not read, or means another layout or an impossible round.
        """
        return decode_header(raw, layout, self._last, self._most)

    def admits(self, sender: str) -> bool:
        """Whether to read anything of this sender's."""
        if not self.guard.admits(sender):
            return False
        if sender == self._agent or sender not in self._members:
            text = f'"{sender}" is not another agent of this swarm'
            self.guard.reject(sender, PayloadError("stranger", text))
            return False
        return True

    def refuse(self, sender: str, error: PayloadError) -> None:
        """Count what was refused."""
        if error.cause != "key" or self.guard.admits(sender):
            self.guard.reject(sender, error)

    def check(self, sender: str, life: str, kind: str, header: bytes, length: int) -> None:
        """Judge a message by its header, before its ``length`` bytes come.

        Raises:
            PayloadError: its header will not do, or it is too long.
        """
        self._read(sender, life, kind, header)
        layout = self._layout_of(kind)
        longest = layout.size * layout.copies * layout.dtype.itemsize + SPARE
        if length > longest:
            raise PayloadError("length", f"message of {length} bytes: expected {longest} at most")

    def receive(self, arrival: Arrival) -> None:
        """Take a message."""
        header = self._read(arrival.sender, arrival.life, arrival.kind, arrival.header)
        if arrival.kind == STATE:
            vector = decode_body(arrival.body, self._layout_of(STATE), Plain())
            self.on_state(Message(header, vector))
            return
        vector = decode_body(arrival.body, self._layout, self._codec, self._longest)
        self.inbox.store(Message(header, vector))

    def note(self, sender: str, life: str, kind: str, header: bytes) -> None:
        """Take a note."""
        read = self._read(sender, life, kind, header)
        if kind in {BEAT, SENT}:
            self.inbox.touch(read)
        if kind != BEAT:
            self.on_note(kind, read)

    def progress(self, sender: str) -> None:
        """Bytes of a message that is not complete have come."""
        self.inbox.progress(sender)

    def _layout_of(self, kind: str) -> Layout:
        return plain(self._layout) if kind in {STATE, JOIN} else self._layout

    def _read(self, sender: str, life: str, kind: str, raw: bytes) -> ParameterHeader:
        if kind not in KINDS:
            raise PayloadError("kind", f"message of kind {kind!r}: expected {', '.join(KINDS)}")
        header = self.read_header(raw, self._layout_of(kind))
        self.check_sender(header, sender)
        if header.incarnation != life:
            raise PayloadError("incarnation", f"{sender} speaks for {header.incarnation} as {life}")
        return header

    def check_sender(self, header: ParameterHeader, sender: str) -> None:
        """The header must name another member in its present life, and the key the same one.

        Access control proves the key, so the header may not say otherwise.  (Zenoh can deliver a
        sample under another sender's key after a link was lost; with wildcard subscriptions that
        is one in a million, and the sender says it again.)
        """
        if header.agent != sender:
            raise PayloadError("key", f'"{header.agent}" speaks under the key of "{sender}"')
        if header.agent == self._agent or header.agent not in self._members:
            raise PayloadError("stranger", f'"{header.agent}" is not another agent of this swarm')
        known = self._roster.incarnation(header.agent)
        # The first message of a life may overtake its token.
        if known is not None and order(header.incarnation) < order(known):
            raise PayloadError(
                "incarnation",
                f"{header.agent} in its life {header.incarnation}: expected {known}",
            )
