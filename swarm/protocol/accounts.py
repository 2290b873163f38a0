"""What the two ends of an edge used of it, so that both keep a round or neither.

W must be symmetric on what was really exchanged, or the swarm's mean moves.  So every header
states, for each edge, the rounds that its sender used and keeps.  Who used round k, and hears its
neighbour speak of a later round without having used k, takes its share back; that is final, for
nobody returns to a round.  Two rounds are enough to list: before an end uses another round it has
its neighbour's message of that round, which settles the one before, so at most one is open.

The duals of an exact rule are kept per edge and must cancel.  They are booked on an account with a
number.  After a new life of either end it goes on only if both list the same rounds (a swarm that
resumes); else, and after some rounds without a use, an end forgets the edge's duals and begins a
new account.  Until both state the same number, neither uses the edge.  :func:`successor` is one
function of the same two statements on both sides, so they need not agree on when to apply it.
"""

from dataclasses import dataclass

from swarm.protocol.messages import LISTED, Statement

UNUSED = 5  # rounds without a use after which an edge's duals are forgotten


@dataclass(slots=True)
class Account:
    """One end's side of one edge.

    Attributes:
        number: of the duals' account.
        booked: uses booked on it, less those taken back.
        rounds: the last rounds used and kept, the open one included.
        open: the round whose use the other end has not confirmed.
        lives: of both ends when they last met.
        uses: how many rounds in all.
        one_sided: how many of them were taken back.
        idle: rounds in a row in which the edge was not used.
    """

    number: int = 0
    booked: int = 0
    rounds: tuple[int, ...] = ()
    open: int | None = None
    lives: tuple[str, str] = ("", "")
    uses: int = 0
    one_sided: int = 0
    idle: int = 0

    @property
    def recent(self) -> bool:
        """Whether the other end may still have to hear of a use."""
        return self.open is not None or (bool(self.rounds) and self.idle < UNUSED)

    def state(self, life: str = "") -> Statement:
        """What is said of it to the other end in this life."""
        return Statement(self.number, self.booked == 0, self.rounds, self.uses, life)

    def use(self, round_: int) -> None:
        """Use the edge in a round."""
        self.rounds, self.open = (*self.rounds, round_)[-LISTED:], round_
        self.booked, self.uses, self.idle = self.booked + 1, self.uses + 1, 0

    def count(self) -> None:
        """Use the edge where rounds are not common: nothing can be taken back, but it is told."""
        self.uses += 1

    def settle(self, theirs: Statement, round_: int) -> int | None:
        """Hear the other end speak in ``round_``; the round to take back, if it did not use it."""
        if self.open is None or round_ <= self.open:
            return None
        # What it used of a former life of ours, it did not use of this one.
        former = theirs.life not in {"", self.lives[0]}
        return self._close(Statement() if former else theirs)

    def meet(self, theirs: Statement, lives: tuple[str, str]) -> tuple[bool, int | None]:
        """Compare accounts: whether the edge's duals are void, and the round to take back."""
        follower = successor(self.state(), theirs, lives == self.lives)
        taken = None
        if lives != self.lives:
            taken, self.lives = self._close(theirs), lives
            if follower != self.number:
                self.rounds = ()
        void = follower != self.number
        if void:
            self.number, self.booked = follower, 0
        return void, taken

    def rest(self) -> bool:
        """Count a round without use; whether the edge's duals are void from now on."""
        self.idle += 1
        void = self.idle == UNUSED and self.booked > 0
        if void:
            self.number, self.booked = self.number + 1, 0
        return void

    def _close(self, theirs: Statement) -> int | None:
        settled, self.open = self.open, None
        if settled is None or settled in theirs.rounds:
            return None
        self.rounds = tuple(kept for kept in self.rounds if kept != settled)
        self.uses, self.one_sided = self.uses - 1, self.one_sided + 1
        self.booked = max(0, self.booked - 1)
        return settled


def successor(own: Statement, theirs: Statement, same_lives: bool) -> int:
    """Number of the account with which an end goes on, given what both ends stated."""
    if own.number == theirs.number:
        goes_on = same_lives or own.rounds == theirs.rounds or own.fresh
        return own.number if goes_on else own.number + 1
    later = max(own.number, theirs.number)
    return later if (own if own.number > theirs.number else theirs).fresh else later + 1
