"""What a joiner needs to go on where the swarm is: a neighbour's round and parameters."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import zenoh

from swarm.errors import PayloadError
from swarm.mixing.compression import Plain
from swarm.wire.dispatch import Dispatch
from swarm.wire.keys import Keys
from swarm.wire.payload import Layout, Message, ParameterHeader, decode_body, encode_header
from swarm.wire.reception import Reception

State = tuple[int, float, tuple[str, ...], bytes]


@dataclass(frozen=True, slots=True)
class Handover:
    """Answers joiners, and asks as one.

    Attributes:
        session: an open session.
        keys: the swarm's keys.
        agent: own id.
        layout: of the parameters alone, as they are: one copy, not encoded.
        reception: reads and judges answers.
        dispatch: signs them.
    """

    session: zenoh.Session
    keys: Keys
    agent: str
    layout: Layout
    reception: Reception
    dispatch: Dispatch

    def serve(self, newest: Callable[[], State]) -> "zenoh.Queryable[None]":
        """Answer joiners with (round, learned, neighbours, bytes of theta) from ``newest``."""

        def answer(query: zenoh.Query) -> None:
            round_, learned, neighbours, body = newest()
            header = self.dispatch.sign(self.layout, round_, neighbours, learned=learned)
            query.reply(self.keys.state(self.agent), body, attachment=encode_header(header))

        return self.session.declare_queryable(self.keys.state(self.agent), answer)

    def fetch(self, timeout: float) -> Message | None:
        """The newest parameters that anybody present has, or None if none come in time [s]."""
        best: Message | None = None
        for reply in self.session.get(
            self.keys.state(), timeout=timeout, consolidation=zenoh.ConsolidationMode.NONE
        ):
            if reply.ok is None:
                continue
            _, sender = Keys.identity(str(reply.ok.key_expr))
            try:
                header = self.reception.read_header(reply.ok.attachment, self.layout)
                if header.agent != sender:
                    raise PayloadError("key", f'"{header.agent}" answers as "{sender}"')
                vector = decode_body(reply.ok.payload.to_bytes(), self.layout, Plain())
            except PayloadError as error:
                self.reception.guard.reject(sender, error)
                continue
            if header.agent != self.agent and (
                best is None or _reach(header) > _reach(best.header)
            ):
                best = Message(header, vector)
        return best


def plain(layout: Layout) -> Layout:
    """The layout of parameters that are handed over, where messages have ``layout``."""
    return replace(layout, copies=1, codec="none")


def _reach(header: ParameterHeader) -> tuple[float, int]:
    """How far a sender has come: what it has learned, or, where rounds are common, its round."""
    return header.learned, header.round
