"""Parameters that come in: checked on Zenoh's thread, kept for the rounds or refused.

A message counts when its header reads, names the sender that its key names, another member of the
swarm in its present life, and when its body is finite and not absurdly long.
"""

import math
from collections.abc import Collection
from typing import Self

import zenoh

from swarm.errors import PayloadError
from swarm.mixing.compression import Codec
from swarm.protocol.guard import Guard
from swarm.protocol.messages import ParameterHeader, order
from swarm.wire.inbox import Inbox
from swarm.wire.keys import Keys
from swarm.wire.parcels import unwrap
from swarm.wire.payload import (
    Layout,
    Message,
    check_norm,
    decode_body,
    decode_header,
)
from swarm.wire.roster import Roster

NORM_FACTOR = 100.0  # times the own norm, or 1, is as large as a neighbour's may be


class Reception:
    """One agent's incoming parameters; a context manager that listens.

    Args:
        session: an open session.
        keys: the swarm's keys.
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
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
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
        self._session, self._agent, self._members = session, agent, members
        self._layout, self._codec, self._roster = layout, codec, roster
        self._last, self._most = last, most
        self._longest = math.inf  # norm of a neighbour's parameters; not known before the own
        roster.call_on_change(self.inbox.wake)
        self._subscriber = session.declare_subscriber(keys.params(receiver=agent), self._receive)

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

    def read_header(self, attachment: zenoh.ZBytes | None, layout: Layout) -> ParameterHeader:
        """The header of a message or an answer.

        Raises:
            PayloadError: it does not read, or means another layout or an impossible round.
        """
        raw = None if attachment is None else attachment.to_bytes()
        return decode_header(raw, layout, self._last, self._most)

    def _receive(self, sample: zenoh.Sample) -> None:
        try:
            _, sender = Keys.identity(key := str(sample.key_expr))
        except PayloadError as error:
            if self.guard.admits(key):
                self.guard.reject(key, error)
            return
        if not self.guard.admits(sender):
            return
        try:
            header = self.read_header(sample.attachment, self._layout)
            self.check_sender(header, sender)
            if len(sample.payload) == 0:
                self.inbox.touch(header)
                return
            body = unwrap(sample.payload)
            vector = decode_body(body, self._layout, self._codec, self._longest)
        except PayloadError as error:
            self.guard.reject(sender, error)
        else:
            self.inbox.store(Message(header, vector))

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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if not self._session.is_closed():
            self._subscriber.undeclare()
