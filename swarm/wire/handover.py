"""What a joiner needs to go on where the swarm is: a neighbour's round and parameters.

Interface: :meth:`Handover.serve` at those who are there, :meth:`Handover.fetch` at the one who
comes.  Everybody who is asked answers with a header; whose is believed is decided by
:func:`swarm.protocol.transfer.choose`; its parameters come over the links, at whatever rate they
take, and are believed if they are what the header said.
"""

import logging
import queue
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import msgspec
import numpy as np
import zenoh

from swarm.errors import PayloadError
from swarm.protocol.messages import ParameterHeader
from swarm.protocol.transfer import Answer, choose
from swarm.wire.buffers import Body
from swarm.wire.dispatch import JOIN, STATE
from swarm.wire.keys import Keys
from swarm.wire.links import Links
from swarm.wire.payload import Layout, Message, encode_header
from swarm.wire.reception import Reception

log = logging.getLogger(__name__)
AGAIN = 0.5  # [s] until the joiner asks again, while nothing comes
State = tuple[ParameterHeader, Body]  # of one round, although the rounds go on meanwhile


@dataclass(frozen=True, slots=True)
class Handover:
    """Answers joiners, and asks as one.

    Attributes:
        session: an open session.
        keys: the swarm's keys.
        agent: own id.
        layout: of the parameters alone, as they are: one copy, not encoded.
        reception: reads and judges answers.
        links: by which parameters come.
        sign: makes a header in this agent's name.
        joins: takes what to do when a joiner asks.
    """

    session: zenoh.Session
    keys: Keys
    agent: str
    layout: Layout
    reception: Reception
    links: Links
    sign: Callable[[], ParameterHeader]
    joins: Callable[[Callable[[str], None]], None]

    def serve(self, newest: Callable[[], State]) -> "zenoh.Queryable[None]":
        """Answer joiners with the header and the bytes of theta from ``newest``."""

        def answer(query: zenoh.Query) -> None:
            header = self._encode(newest()[0])
            query.reply(self.keys.state(self.agent), b"", attachment=header)

        def hand_over(to: str) -> None:
            header, body = newest()
            self.links.send(to, STATE, self._encode(header), body)

        self.joins(hand_over)
        return self.session.declare_queryable(self.keys.state(self.agent), answer)

    def _encode(self, header: ParameterHeader) -> bytes:
        fingerprint = self.layout.fingerprint
        return encode_header(msgspec.structs.replace(header, fingerprint=fingerprint))

    def fetch(
        self,
        timeout: float,
        lives: Callable[[Collection[str]], Mapping[str, str]],
        run: str | None,
        reached: float,
    ) -> Answer | None:
        """The state to go on with, or None: one's own.

        Args:
            timeout: for all to answer, and then without a byte of the parameters [s].
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
                attached = reply.ok.attachment
                raw = None if attached is None else attached.to_bytes()
                header = self.reception.read_header(raw, self.layout)
                self.reception.check_sender(header, sender)
            except PayloadError as error:
                self.reception.guard.reject(sender, error)
                continue
            answers[sender] = Answer(header, None)
        while (best := choose(list(answers.values()), lives(answers), run, reached)) is not None:
            if best.vector is not None:
                return best
            sender, message = best.header.agent, self._take(best.header.agent, timeout)
            if message is None:
                log.warning("%s answered, but its parameters did not come", sender)
                del answers[sender]
                continue
            norm = float(np.linalg.norm(message.vector))
            header = msgspec.structs.replace(message.header, norm=norm)
            answers[sender] = Answer(header, message.vector)
        return None

    def _take(self, sender: str, timeout: float) -> Message | None:
        """A member's parameters; None when nothing of them comes for so long [s]."""
        arrived: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self.reception.on_state = arrived.put
        self.links.reach(sender)
        asked = time.monotonic()
        while (now := time.monotonic()) < max(asked, self.links.moved(sender)) + timeout:
            if now > self.links.moved(sender) + AGAIN:
                self.links.note(sender, JOIN, self._encode(self.sign()))
            try:
                message = arrived.get(timeout=AGAIN)
            except queue.Empty:
                continue
            if message.header.agent == sender:
                return message
        return None
