"""What the protocol asks of whoever drives it."""

from collections.abc import Mapping
from dataclasses import dataclass

from swarm.protocol.accounts import Account
from swarm.protocol.messages import ParameterHeader
from swarm.protocol.peers import Delivery


@dataclass(frozen=True, slots=True)
class Send:
    """Send a header to some members, with the vector of its round or without."""

    to: tuple[str, ...]
    header: ParameterHeader
    vector: bool


@dataclass(frozen=True, slots=True)
class Await:
    """Wait for the next event, at most until a time [s], because of these causes.

    Attributes:
        causes: what is awaited of whom, by member; by ``""`` of the swarm.
        until: when to look again [s].
    """

    causes: Mapping[str, str]
    until: float


@dataclass(frozen=True, slots=True)
class Begin:
    """All that is needed to start is here: begin the round."""

    run: str


@dataclass(frozen=True, slots=True)
class Again:
    """The neighbours have changed while this round could not go on: send it to the new ones."""


@dataclass(frozen=True, slots=True)
class Mix:
    """End the round: use these vectors, take these shares back, go on with that round.

    Attributes:
        used: vectors that count, by neighbour; the other end counts ours.
        degrees: number of neighbours of each sender in ``used``.
        missing: neighbours whose vectors do not.
        taken_back: neighbour and round of earlier shares that turned out one-sided.
        void: neighbours whose duals are to be forgotten before mixing.
        accounts: of all edges as they are now, for a checkpoint.
        next_round: with which to go on; more than one on after falling behind.
    """

    used: Mapping[str, Delivery]
    degrees: Mapping[str, int]
    missing: tuple[str, ...]
    taken_back: tuple[tuple[str, int], ...]
    void: tuple[str, ...]
    accounts: Mapping[str, Account]
    next_round: int


@dataclass(frozen=True, slots=True)
class Say:
    """Tell the operator, a line a minute and cause at most."""

    cause: str
    line: str


@dataclass(frozen=True, slots=True)
class End:
    """Stop this process: a later life of this agent has begun."""

    line: str


Action = Send | Await | Begin | Again | Mix | Say | End
