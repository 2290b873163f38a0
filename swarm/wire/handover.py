"""What a joiner needs to go on where the swarm is: a neighbour's round and parameters.

Interface: :meth:`Handover.serve` at those who are there, :meth:`Handover.fetch` at the one who
comes.  Whose answer is believed is decided by :func:`swarm.protocol.transfer.choose`.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

import msgspec
import numpy as np
import zenoh

from swarm.errors import PayloadError
from swarm.mixing.compression import Plain
from swarm.protocol.messages import ParameterHeader
from swarm.protocol.transfer import Answer, choose
from swarm.wire.keys import Keys
from swarm.wire.payload import Layout, decode_body, encode_header
from swarm.wire.reception import Reception

State = tuple[ParameterHeader, bytes]  # of one round, although the rounds go on meanwhile


@dataclass(frozen=True, slots=True)
class Handover:
    """Answers joiners, and asks as one.

    Attributes:
        session: an open session.
        keys: the swarm's keys.
        agent: own id.
        layout: of the parameters alone, as they are: one copy, not encoded.
        reception: reads and judges answers.
    """

    session: zenoh.Session
    keys: Keys
    agent: str
    layout: Layout
    reception: Reception

    def serve(self, newest: Callable[[], State]) -> "zenoh.Queryable[None]":
        """Answer joiners with the header and the bytes of theta from ``newest``."""

        def answer(query: zenoh.Query) -> None:
            header, body = newest()
            header = msgspec.structs.replace(header, fingerprint=self.layout.fingerprint)
            query.reply(self.keys.state(self.agent), body, attachment=encode_header(header))

        return self.session.declare_queryable(self.keys.state(self.agent), answer)

    def fetch(
        self,
        timeout: float,
        lives: Callable[[Collection[str]], Mapping[str, str]],
        run: str | None,
        reached: float,
    ) -> Answer | None:
        """The state to go on with, or None: one's own.

        Args:
            timeout: for all to answer [s].
            lives: of the members who are here, those who answered among them if they are.
            run: of the own checkpoint, None if there is none.
            reached: how far the own state is [rounds].
        """
        answers: dict[str, Answer] = {}
        for reply in self.session.get(
            self.keys.state(), timeout=timeout, consolidation=zenoh.ConsolidationMode.NONE
        ):
            if reply.ok is None:
                continue
            try:
                _, sender = Keys.identity(key := str(reply.ok.key_expr))
            except PayloadError as error:
                self.reception.guard.reject(key, error)
                continue
            try:
                header = self.reception.read_header(reply.ok.attachment, self.layout)
                self.reception.check_sender(header, sender)
                vector = decode_body(reply.ok.payload.to_bytes(), self.layout, Plain())
            except PayloadError as error:
                self.reception.guard.reject(sender, error)
                continue
            header = msgspec.structs.replace(header, norm=float(np.linalg.norm(vector)))
            answers[sender] = Answer(header, vector)
        return choose(list(answers.values()), lives(answers), run, reached)


def plain(layout: Layout) -> Layout:
    """The layout of parameters that are handed over, where messages have ``layout``."""
    return replace(layout, copies=1, codec="none")
