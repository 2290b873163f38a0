"""Parameters that go out: one message a round for all neighbours, and headers alone."""

from collections.abc import Iterable

from swarm.protocol.messages import ParameterHeader
from swarm.wire.buffers import Body
from swarm.wire.links import Links
from swarm.wire.payload import encode_header

ROUND, STATE = "round", "state"  # kinds of messages: of a round, and what a joiner gets
# Kinds of notes: a sign of life; "you must have my round"; "I do not"; "hand me your state".
BEAT, SENT, WANT, JOIN = "beat", "sent", "want", "join"


class Dispatch:
    """One agent's outgoing parameters.

    Args:
        links: by which they leave.
        together: whether rounds are common: a neighbour may need two in a row, so the second does
            not replace the first.
    """

    def __init__(self, links: Links, together: bool) -> None:
        self._links, self._together = links, together
        self._header, self._round = b"", 0
        self._body: Body = b""

    def prepare(self, header: ParameterHeader, body: Body) -> None:
        """Make the message of a round; see :meth:`swarm.exchange.Exchange.publish`."""
        self._header, self._body, self._round = encode_header(header), body, header.round

    def send(self, neighbours: Iterable[str]) -> None:
        """Hand the message to the links."""
        slot = self._round % 2 if self._together else 0
        for neighbour in neighbours:
            self._links.send(neighbour, ROUND, self._header, self._body, slot)

    def note(self, agents: Iterable[str], kind: str, header: ParameterHeader) -> None:
        """Send a header alone, ahead of everything."""
        encoded = encode_header(header)
        for agent in agents:
            self._links.note(agent, kind, encoded)
