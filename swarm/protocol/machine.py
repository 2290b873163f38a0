"""The protocol of a synchronous swarm, from one agent's side: events in, actions out.

Interface: tell a :class:`Machine` who is :meth:`~Machine.present`, what was :meth:`~Machine.heard`,
when a round :meth:`~Machine.begin` s; then :meth:`~Machine.poll` it, do what it returns, and poll
again when something happens or at the latest when the returned :class:`Await` says.  There is no
clock, thread or socket in here: time is an argument.  See :mod:`swarm.protocol` for the rules.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from swarm.protocol.accounts import Account
from swarm.protocol.actions import Action, Again, Await, Begin, End, Mix, Say, Send
from swarm.protocol.membership import Membership
from swarm.protocol.messages import (
    PROTOCOL,
    ParameterHeader,
    Phase,
    Statement,
    order,
    statement_on,
)
from swarm.protocol.peers import Delivery, Peer
from swarm.protocol.quorum import Quorum
from swarm.protocol.timing import Timing, deadline

GRACE = 3  # rounds that an agent without a quorum plays to come into step with a neighbour
REMEMBERED = 32  # rounds whose duration sets the deadline
Topology = Callable[[tuple[str, ...]], tuple[str, ...]]


class Machine:
    """One agent's protocol.

    Args:
        agent: own id.
        life: own life.
        members: every id of the swarm, in the topology's order.
        topology: the agent's neighbours among those of the members who are here.
        fingerprint: of all that must agree.
        last: number of rounds of the experiment.
        timing, quorum: limits.
        run: of the experiment, as a checkpoint has it; None for a new one.

    Attributes:
        round: the round under way.
        phase: ``starting``, ``playing`` or ``finished``.
        peers: what is known of the other members.
        causes: what is awaited at present, for those who ask.
        nearby: the neighbours of the round under way.
        needed: neighbours of whom it goes on with no fewer.
        superseded: why this life must end, if it must.
        timing: limits.
    """

    def __init__(
        self,
        agent: str,
        life: str,
        members: tuple[str, ...],
        topology: Topology,
        fingerprint: str,
        last: int,
        timing: Timing,
        quorum: Quorum,
        run: str | None = None,
    ) -> None:
        self.agent, self.life, self.members = agent, life, members
        self.round, self.norm, self.learned = 0, 0.0, 0.0
        self.phase: Phase = "starting"
        self.peers = {member: Peer() for member in members if member != agent}
        self.causes: Mapping[str, str] = {}
        self.nearby: tuple[str, ...] = ()
        self.membership = Membership(self.peers, life, run, quorum)
        self._topology, self._fingerprint = topology, fingerprint
        self._last, self.timing, self._quorum = last, timing, quorum
        self.needed = quorum.of(len(topology(members)))
        self._durations: deque[float] = deque(maxlen=REMEMBERED)
        self._work: deque[float] = deque(maxlen=REMEMBERED)
        self._header: ParameterHeader | None = None
        self._taken_back: list[tuple[str, int]] = []
        self._void: list[str] = []
        self._published = self._ready = self._resend_at = self._beat_at = 0.0
        self._ask_at, self._graced_at, self._grace = 0.0, -quorum.patience, 0
        self._interval, self._limit = timing.resend, timing.round
        self._in_step = 0.0  # when this agent was last in step with anybody [s]
        self._below: float | None = None  # since when it has mixed with too few [s]
        self.superseded: str | None = None

    def present(self, now: float, lives: Mapping[str, str], own: str) -> None:
        """Membership: who is here and in which life; ``own``: the latest life of this very id."""
        for member, peer in self.peers.items():
            peer.seen(lives.get(member))
        if order(own) > order(self.life):
            self.superseded = (
                f"a later life of {self.agent} has begun ({own}, this is {self.life}): it ends"
            )

    def heard(self, now: float, header: ParameterHeader, vector: Any | None) -> bool:
        """A message of another member; False if a life that is over sent it."""
        peer = self.peers[header.agent]
        if not peer.hear(now, header, vector, self.membership.run):
            return False
        if peer.view is header:
            self._compare(header.agent)
        return True

    def _compare(self, agent: str) -> None:
        """Hold a neighbour's account of the edge against the own."""
        peer = self.peers[agent]
        if peer.view is None or peer.view.run != self.membership.run:
            return
        theirs = statement_on(peer.view, self.agent)
        if theirs is None:
            return
        void, taken = peer.account.meet(theirs, (self.life, peer.view.incarnation))
        if taken is None:
            taken = peer.account.settle(theirs, peer.view.round)
        if taken is not None:
            self._taken_back.append((agent, taken))
        if void:
            self._void.append(agent)

    def progress(self, now: float, agent: str) -> None:
        """Something of a member's is on its way, though not all here: no limit runs out on it."""
        peer = self.peers[agent]
        peer.heard = peer.moved = now
        peer.late = False

    def begin(
        self, now: float, round_: int, norm: float, limit: float | None = None
    ) -> tuple[Send, ...]:
        """A round begins: what to send; its vector is this round's from now on.

        Args:
            now: the time [s].
            round_: its number.
            norm: of the own parameters.
            limit: how long to wait [s]; by default what recent rounds suggest.
        """
        self.round, self.norm = round_, norm
        self.phase = "finished" if round_ >= self._last else "playing"
        self.membership.reconsider()
        for agent in self.peers:
            self._compare(agent)
        self.nearby = self.neighbours()
        self._limit = deadline(self._durations, self.timing) if limit is None else limit
        self._published = self._ready = now
        self._interval = self.timing.resend
        self._resend_at, self._beat_at = now + self._interval, now + self.timing.beat
        self._header = self.sign()
        sends = [Send(self.nearby, self._header, vector=True)]
        if self._header.former:
            sends.append(Send(tuple(self._header.former), self._header, vector=False))
        if now >= self._ask_at and (others := self._unknown()):
            self._ask_at = now + self.timing.beat
            sends.append(Send(others, self.sign(asks=True), vector=False))
        return tuple(sends)

    def _unknown(self) -> tuple[str, ...]:
        """Who is here, but not in this run as far as is known: it may have changed its mind."""
        return tuple(m for m in self._here() if not self.membership.fellow(m))

    def ready(self, now: float) -> None:
        """The own step is done; from now on the round waits for the others only."""
        self._ready = now
        self._work.append(max(now - self._published, 1e-4))
        self._beat_at = min(self._beat_at, now + self.timing.beat)
        self._resend_at = now + self._interval

    @property
    def pending(self) -> tuple[tuple[str, int], ...]:
        """Neighbour and round of shares that the next :class:`Mix` takes back."""
        return tuple(self._taken_back)

    def adopt(self, run: str) -> None:
        """A member's state was taken, and with it its run; what the own had used is void."""
        self.membership.run = run
        self.membership.settle()
        for peer in self.peers.values():
            peer.account = Account()

    def sign(self, asks: bool = False) -> ParameterHeader:
        """A header in this agent's name."""
        return ParameterHeader(
            version=PROTOCOL,
            fingerprint=self._fingerprint,
            agent=self.agent,
            incarnation=self.life,
            round=self.round,
            run=self.membership.run,
            phase=self.phase,
            neighbours={n: self._state(n) for n in self.nearby},
            former={
                n: self._state(n)
                for n, peer in self.peers.items()
                if n not in self.nearby and peer.token and peer.account.recent
            },
            learned=self.learned,
            norm=self.norm,
            asks=asks,
        )

    def _state(self, agent: str) -> Statement:
        peer = self.peers[agent]
        return peer.account.state(peer.life)

    def poll(self, now: float) -> list[Action]:
        """What to do now; the last action says how to go on."""
        if self.superseded is not None:
            return [End(self.superseded)]
        actions: list[Action] = list(self._answers())
        if self.phase == "starting":
            return [*actions, *self._start(now)]
        waiting = self._awaited()
        late = self._late(waiting, now)
        for agent, line in late.items():
            waiting.discard(agent)
            actions.append(Say(f"late/{agent}", f"round {self.round}: {line}"))
        if waiting:
            self.causes = dict.fromkeys(sorted(waiting), f"parameters of round {self.round}")
            return [*actions, *self._remind(now, waiting), self._wait(now)]
        return [*actions, *self._finish(now)]

    def _answers(self) -> Iterable[Send]:
        """Answer those who ask, and those who wait for this agent in vain."""
        if asked := tuple(a for a, peer in self.peers.items() if peer.asked and peer.token):
            for agent in asked:
                self.peers[agent].asked = False
            yield Send(asked, self.sign(), vector=False)

    def _start(self, now: float) -> list[Action]:
        verdict = self.membership.may_start(now, self.timing, self.needed)
        if verdict.ready:
            return [Begin(self.membership.run)]
        self.causes = verdict.causes
        actions: list[Action] = []
        if now >= self._beat_at:
            self._beat_at = now + self.timing.resend
            actions.append(Send(self._here(), self.sign(asks=True), vector=False))
        return [*actions, Await(self.causes, self._beat_at)]

    def start(self, now: float, round_: int, together: bool) -> None:
        """Announced: begin to look for the others; ``together``: wait for all of them a while."""
        self.round, self._beat_at, self._in_step = round_, now, now
        self.membership.start(now, together)

    def neighbours(self) -> tuple[str, ...]:
        """Own neighbours in the topology over those who are here, in this run."""
        return self._topology(self._fellows())

    def _here(self) -> tuple[str, ...]:
        return tuple(agent for agent, peer in self.peers.items() if peer.token is not None)

    def _fellows(self) -> tuple[str, ...]:
        """Members, oneself included, that are here and in this run."""
        return tuple(m for m in self.members if m == self.agent or self.membership.fellow(m))

    def _awaited(self) -> set[str]:
        """Neighbours whose vector of this round may still come."""
        return {n for n in self.nearby if self._may_come(self.peers[n])}

    def _may_come(self, peer: Peer) -> bool:
        if peer.token is None or peer.late or peer.barred > self.round:
            return False
        if self.round in peer.vectors or peer.round > self.round:
            return False
        if peer.view is None or peer.round < self.round or peer.view.phase == "starting":
            return True
        return self.agent in peer.view.neighbours  # else it plays this round with others

    def _late(self, waiting: Iterable[str], now: float) -> dict[str, str]:
        """Who has run out of time; one that waits for somebody else gives signs of life."""
        spent = now - self._published
        if spent < self._limit:
            return {}
        late = {}
        for agent in sorted(waiting):
            peer = self.peers[agent]
            if now - max(self._published, peer.moved) >= self.timing.round:
                peer.penalize(self.round)
                late[agent] = f"{agent} gives signs of life but no parameters for {spent:.1f} s"
            elif now - max(peer.heard, self._published) >= self._limit / 2:
                peer.late = True
                late[agent] = f"no parameters from {agent} within {spent:.1f} s, going on without"
        return late

    def _remind(self, now: float, waiting: set[str]) -> list[Action]:
        """Send again, it may be the own message that was lost; or a sign of life."""
        assert self._header is not None
        if now >= self._resend_at:
            self._interval *= 2
            self._resend_at, self._beat_at = now + self._interval, now + self.timing.beat
            return [Send(tuple(sorted(waiting)), self._header, vector=True)]
        if now >= self._beat_at:
            self._beat_at = now + self.timing.beat
            return [Send(self.nearby, self._header, vector=False)]
        return []

    def _wait(self, now: float) -> Await:
        until = min(self._resend_at, self._beat_at, now + self._limit / 4)
        return Await(self.causes, max(until, now + 1e-3))

    def _finish(self, now: float) -> list[Action]:
        """Nobody is awaited any more: mix, or wait for enough neighbours to mix with."""
        used = {n: d for n in self.nearby if (d := self._usable(n)) is not None}
        ahead, lacking = self.membership.ahead(self.round, self._bound(now), self._last)
        done = self.membership.done(self._last) & set(self.nearby)
        if len(used.keys() | done) >= self.needed or self.phase == "finished":
            self._below = None
        elif self._below is None:
            self._below = now
        short = self._below is not None and now >= self._below + self._quorum.patience
        actions: list[Action] = []
        if (short or lacking) and now >= self._ask_at:
            self._ask_at = now + self.timing.resend
            actions.append(Send(self._here(), self.sign(asks=True), vector=False))
        if short:
            line = f"quorum: {len(used)} of {self.needed} neighbours needed (quorum.minimum)"
            actions.append(Say("quorum", f"round {self.round}: {line}"))
            if ahead is None and not self._graced(now):
                return [*actions, *self._hold(now, line)]
        if used or ahead is not None:
            self._in_step = now
        self._durations.append(now - self._published)
        self.causes = {}
        return [*actions, self._mix(used, ahead)]

    def _hold(self, now: float, line: str) -> list[Action]:
        """Too few neighbours to go on with: say so, and try this round with them again."""
        if self.neighbours() != self.nearby or now >= self._published + self._limit:
            for neighbour in self.nearby:
                self.peers[neighbour].late, self.peers[neighbour].barred = False, 0
            return [Again()]
        self.causes = {"": line}
        return [Await(self.causes, now + self.timing.resend)]

    def _graced(self, now: float) -> bool:
        """A neighbour is a round further on: a few rounds, to come into step with it."""
        if not any(
            self.peers[n].round > self.round and self.membership.fellow(n) for n in self.nearby
        ):
            return False
        if now >= self._graced_at + self._quorum.patience:
            self._graced_at, self._grace = now, GRACE
        self._grace -= 1
        return self._grace >= 0

    def _usable(self, neighbour: str) -> Delivery | None:
        """The neighbour's vector of this round, if both ends may use the edge in it.

        Both ends ask the same of the same two statements.
        """
        peer, header = self.peers[neighbour], self._header
        delivery = peer.vectors.get(self.round)
        if delivery is None or header is None or not self._current(peer, delivery.header):
            return None
        theirs, own = delivery.header.neighbours.get(self.agent), header.neighbours[neighbour]
        if theirs is None or (theirs.number, theirs.fresh) != (own.number, own.fresh):
            return None
        meant = own.life == delivery.header.incarnation and theirs.life == self.life
        if peer.account.number != own.number or not meant:
            return None
        declined = peer.round > self.round and self.round not in self._stated(peer.view)
        return None if declined else delivery

    def _current(self, peer: Peer, header: ParameterHeader) -> bool:
        """Whether a vector is of this run, and of a life that is here and was met on the edge."""
        if peer.token is None or header.run != self.membership.run:
            return False
        return header.incarnation == peer.life == peer.account.lives[1]

    def _stated(self, view: ParameterHeader | None) -> tuple[int, ...]:
        statement = statement_on(view, self.agent) if view else None
        return statement.rounds if statement else ()

    def _bound(self, now: float) -> float:
        """The largest round that a swarm like this can have reached since we were in step."""
        return self.round + 1 + 16 * (now - self._in_step) / min(self._work, default=1e-3)

    def _mix(self, used: dict[str, Delivery], ahead: int | None) -> Mix:
        for neighbour, peer in self.peers.items():
            if neighbour in used:
                peer.account.use(self.round)
                self.membership.settle()
                peer.penalties = 0
            elif peer.account.rest():
                self._void.append(neighbour)
        taken, void = tuple(self._taken_back), tuple(self._void)
        self._taken_back, self._void = [], []
        return Mix(
            used=used,
            degrees={n: len(d.header.neighbours) for n, d in used.items()},
            missing=tuple(n for n in self.nearby if n not in used),
            taken_back=taken,
            void=void,
            accounts={n: replace(peer.account) for n, peer in self.peers.items()},
            next_round=max(self.round + 1, ahead or 0),
        )
