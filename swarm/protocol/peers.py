"""What one agent knows of another: its life, its newest words, the vectors it sent, their edge."""

from dataclasses import dataclass, field
from typing import Any

from swarm.protocol.accounts import Account
from swarm.protocol.messages import ParameterHeader, order

KEPT = 2  # vectors: neighbours in step are never further apart than one round
PENALTIES = 4  # 2 to this power is the longest time without being awaited [rounds]


@dataclass(frozen=True, slots=True)
class Delivery:
    """A header and the vector that came with it; the protocol does not look into vectors."""

    header: ParameterHeader
    vector: Any


@dataclass(slots=True)
class Peer:
    """Another member of the swarm.

    Attributes:
        token: its present life as membership has it, None while it is not here.
        view: its newest header.
        heard: when it gave its last sign of life [s].
        moved: when part of something between it and this agent arrived [s].
        late: it let a deadline pass and has not been heard since.
        barred: before this round nobody waits for it, for it gave signs of life and nothing else.
        penalties: how often in a row.
        asked: it wants to hear this agent's header.
        vectors: its newest vectors, by round.
        account: of the edge with it.
    """

    token: str | None = None
    view: ParameterHeader | None = None
    heard: float = 0.0
    moved: float = 0.0
    late: bool = False
    barred: int = 0
    penalties: int = 0
    asked: bool = False
    vectors: dict[int, Delivery] = field(default_factory=dict)
    account: Account = field(default_factory=Account)

    @property
    def life(self) -> str:
        """The latest life of it that is known."""
        spoken = self.view.incarnation if self.view else ""
        return max(spoken, self.token or "", key=order)

    @property
    def here(self) -> bool:
        """Whether it is present and has spoken in its present life."""
        return self.token is not None and self.view is not None

    @property
    def round(self) -> int:
        """The newest round that it spoke of, -1 for none."""
        return self.view.round if self.view else -1

    def seen(self, token: str | None) -> None:
        """Membership says in which life it is here, if it is."""
        self.token = token
        if self.view and order(self.view.incarnation) < order(token or ""):
            self.forget()

    def hear(self, now: float, header: ParameterHeader, vector: Any | None, run: str) -> bool:
        """Take in what it says; False if that is of a life that is over.

        Nor may it leave its run, but to come into ours.
        """
        if order(header.incarnation) < order(self.life):
            return False
        known, same = self.view, self.view and self.view.incarnation == header.incarnation
        settled = known and same and known.phase != "starting"
        if known and settled and header.run not in {known.run, run}:
            return False
        if self.view and self.view.incarnation != header.incarnation:
            self.forget()
        if self.view is None or self.view.round <= header.round:
            self.view = header
        self.heard, self.late = now, False
        self.asked |= header.asks
        if vector is not None:
            self.vectors.setdefault(header.round, Delivery(header, vector))
            for old in sorted(self.vectors)[:-KEPT]:
                del self.vectors[old]
        return True

    def forget(self) -> None:
        """Its former life is over; the account shows what of it counts."""
        self.view, self.late, self.barred, self.penalties = None, False, 0, 0
        self.vectors.clear()

    def penalize(self, round_: int) -> None:
        """It held a round up to the very end: do not wait for it for a while."""
        self.barred = round_ + 1 + 2**self.penalties
        self.penalties = min(self.penalties + 1, PENALTIES)
