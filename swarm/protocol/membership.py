"""Who belongs to this run, when to start, and whose word moves an agent on.  Pure.

A run begins with agents that have learned nothing yet: each offers its own life as the run's name,
and all who are still starting take the earliest offer.  Who has a checkpoint keeps its run.  Who is
new joins a run that has begun if two members are in it, or the only other one that is here; so does
one who has fallen behind go on where two others are: nobody is moved by one member's word while
there are others to ask.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from swarm.protocol.messages import order
from swarm.protocol.peers import Peer
from swarm.protocol.quorum import Quorum
from swarm.protocol.timing import Timing

WITNESSES = 2  # whose word moves an agent


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether an agent may start, and else why not, by member."""

    ready: bool
    causes: Mapping[str, str] = field(default_factory=dict)


class Membership:
    """What one agent makes of the others' presence.

    Args:
        peers: what it knows of them.
        life: own life, offered as the run's name.
        run: that of a checkpoint, None for a new one.
        quorum: how few are enough.

    Attributes:
        run: the run that this agent is in, as yet.
    """

    def __init__(
        self, peers: Mapping[str, Peer], life: str, run: str | None, quorum: Quorum
    ) -> None:
        self.run = life if run is None else run
        self._peers, self._quorum = peers, quorum
        self._open = run is None  # whether the run may still change
        self._started, self._together = 0.0, False
        self._begun_at: float | None = None  # when a fellow was first seen to play [s]

    def start(self, now: float, together: bool) -> None:
        """Begin to look for the others."""
        self._started, self._together = now, together

    def settle(self) -> None:
        """Something of this run is in the parameters: from now on the run is what it is."""
        self._open = False

    def fellow(self, member: str) -> bool:
        """Whether a member is here and in this run."""
        peer = self._peers[member]
        return peer.token is not None and peer.view is not None and peer.view.run == self.run

    @staticmethod
    def _witnesses(here: int) -> int:
        """How many must say the same, of so many who are here."""
        return max(1, min(WITNESSES, here))

    def may_start(self, now: float, timing: Timing, needed: int) -> Verdict:
        """Whether all, or after a while enough, of the others are here and in this run."""
        self.reconsider()
        causes: dict[str, str] = {}
        begun = any(
            peer.view.phase != "starting"
            for member, peer in self._peers.items()
            if peer.view is not None and self.fellow(member)
        )
        if begun and self._begun_at is None:
            self._begun_at = now
        since = self._started if self._begun_at is None else self._begun_at
        patience = timing.start if self._together and not begun else timing.state
        for member, peer in self._peers.items():
            if peer.token is None:
                causes |= {member: "its start"} if self._together else {}
            elif peer.view is None:
                causes[member] = "a word of it"
            elif peer.view.run != self.run and peer.view.phase == "starting":
                causes[member] = "its run"
        if causes and now < since + patience:
            return Verdict(False, causes)
        fellows = sum(map(self.fellow, self._peers))
        if fellows < needed:
            others = [m for m, p in self._peers.items() if p.here and not self.fellow(m)]
            why = f"quorum: {fellows} of {needed} neighbours needed (quorum.minimum)"
            if others:
                why += f"; {', '.join(others)} in another run than {self.run}"
            return Verdict(False, {"": why})
        return Verdict(True)

    def reconsider(self) -> None:
        """While nothing of others is mixed, take the run that they have begun, or the earliest."""
        if not self._open:
            return
        views = [p.view for p in self._peers.values() if p.view and p.token]
        begun = Counter(view.run for view in views if view.phase != "starting" or view.round > 0)
        run, votes = max(begun.items(), key=lambda vote: (vote[1], vote[0]), default=("", 0))
        if votes >= self._witnesses(len(views)):
            self.run = run
            return
        offers = [v.run for v in views if v.phase == "starting" and v.round == 0]
        self.run = min([self.run, *(offer for offer in offers if offer not in begun)], key=order)

    def ahead(self, round_: int, bound: float, last: int) -> tuple[int | None, bool]:
        """Where to go on, if the others have left this round behind.

        Args:
            round_: the round under way.
            bound: the largest round that is possible by now.
            last: the end of the experiment, to which nobody is carried by others.

        Returns:
            The round, or None; and whether somebody claims to be ahead whom nobody confirms.
        """
        claims = sorted(
            (p.round for m, p in self._peers.items() if self.fellow(m) and p.round > round_ + 1),
            reverse=True,
        )
        needed = self._witnesses(sum(map(self.fellow, self._peers)))
        if len(claims) < needed:
            return None, bool(claims)
        target = min(claims[needed - 1], last - 1, int(bound))
        return (target, False) if target > round_ + 1 else (None, False)

    def done(self, last: int) -> set[str]:
        """Who has finished, if enough say so."""
        fellows = [member for member in self._peers if self.fellow(member)]
        done = {member for member in fellows if self._peers[member].round >= last}
        return done if len(done) >= self._witnesses(len(fellows)) else set()
