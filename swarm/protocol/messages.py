"""What one agent says to another, and how lives are ordered.

Beside every vector travels a :class:`ParameterHeader`; without a vector it is a sign of life.  It
names the run that it belongs to, the life of its sender, the round, and for every edge of the
sender's what that end of it has used lately (:mod:`swarm.protocol.accounts`).
"""

from collections.abc import Mapping
from typing import Annotated, Literal

import msgspec

PROTOCOL = 4  # raise it when the meaning of a header or body changes
LISTED = 3  # rounds that one end of an edge tells the other of
LARGEST = 2**53  # of any number in a message

Number = Annotated[int, msgspec.Meta(ge=0, le=LARGEST)]
Amount = Annotated[float, msgspec.Meta(ge=0)]  # refuses NaN too
Phase = Literal["starting", "playing", "finished"]


class Statement(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """What one end of an edge says of it.

    Attributes:
        number: of the account of its duals; both ends begin a new one when they disagree.
        fresh: whether nothing has been booked on it.
        rounds: the last :data:`LISTED` rounds in which this end used the edge and keeps it.
        uses: how often it did in all.
        life: of the other end, as this end knows it; a vector of another life was not meant.
    """

    number: Number = 0
    fresh: bool = True
    rounds: Annotated[tuple[Number, ...], msgspec.Meta(max_length=LISTED)] = ()
    uses: Number = 0
    life: Annotated[str, msgspec.Meta(max_length=16)] = ""


class ParameterHeader(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Travels beside one agent's parameters of one round.

    Attributes:
        version: :data:`PROTOCOL` of the sender.
        fingerprint: of all that sender and receiver must agree on
            (:attr:`swarm.wire.payload.Layout.fingerprint`).
        agent: who sends; the key must name the same one.
        incarnation: which life of that agent; see :func:`order`.
        round: number of the round that the parameters enter.
        run: which run of the experiment; nothing of another run is used.
        phase: ``starting``: waits for the others, and may yet take another's run.
        neighbours: with whom the sender exchanges in this round and what it says of each edge; an
            edge counts when both name each other, and its weight follows from both numbers of
            neighbours.
        former: likewise of edges that it used until a moment ago and that are none any more.
        learned: what the sender has learned so far [rounds], in a swarm without common rounds; see
            :mod:`swarm.mixing.staleness`.
        norm: Euclidean norm of its parameters.
        asks: whether the receiver shall answer with its own header.
    """

    version: int
    fingerprint: str
    agent: str
    incarnation: str
    round: int
    run: Annotated[str, msgspec.Meta(max_length=64)] = ""
    phase: Phase = "playing"
    neighbours: dict[str, Statement]
    former: dict[str, Statement] = {}
    learned: Amount = 0.0
    norm: Amount = 0.0
    asks: bool = False


def order(life: str) -> int:
    """Place of a life among those of one id: the later, the larger; -1 for what is none."""
    try:
        return int(life, 16) if len(life) <= 16 else -1
    except ValueError:
        return -1


def newest(lives: Mapping[str, str] | list[str]) -> str:
    """The latest of some lives."""
    return max(lives, key=order, default="")


def life_after(clock: float, chance: int, known: list[str]) -> str:
    """A new life's name: later than the clock's reading and than every life that is known.

    Args:
        clock: Unix time [s]; it may be wrong, therefore the others.
        chance: 0 to 4095, to tell two apart that start in the same microsecond.
        known: lives of the same id that others have heard of.
    """
    latest = max((order(life) for life in known), default=-1)
    return f"{max((int(clock * 1e6) << 12) | chance, latest + 1):016x}"


def statement_on(header: ParameterHeader, agent: str) -> Statement | None:
    """What a header says of the edge with an agent, if anything."""
    return header.neighbours.get(agent) or header.former.get(agent)
