"""The protocol over Zenoh: one agent's parameters going out and its neighbours' coming in.

Interface: :meth:`Exchange.start` waits until the swarm can begin; then, for every round,
:meth:`Exchange.publish`, which does not wait, and :meth:`Exchange.gather`, which waits until the
protocol (:mod:`swarm.protocol.machine`) ends the round.  A swarm without common rounds takes a
:meth:`Exchange.look` instead.  Whom to wait for, what counts and when to go on is decided there;
here it gets its clock, its messages and its lock.
"""

import logging
import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Self

import zenoh

from swarm.errors import SupersededError
from swarm.mixing.compression import Codec
from swarm.protocol.actions import Action, Again, Await, Begin, End, Mix, Say, Send
from swarm.protocol.machine import Machine
from swarm.protocol.messages import ParameterHeader
from swarm.protocol.peers import Delivery
from swarm.wire.buffers import Body
from swarm.wire.dispatch import BEAT, JOIN, SENT, WANT, Dispatch
from swarm.wire.handover import Handover
from swarm.wire.inbox import Inbox
from swarm.wire.keys import Keys
from swarm.wire.links import Links
from swarm.wire.payload import Layout, plain
from swarm.wire.reception import Reception
from swarm.wire.roster import Roster
from swarm.wire.transport import ZenohTransport

log = logging.getLogger(__name__)
TICK = 0.1  # [s] at most until a wait notices that it must end
SAY_AGAIN = 60.0  # [s] between two lines about one cause
SAY_WAITING = 2.0  # [s] after which a person sees what is awaited
CAUSES = 256  # kept at most


@dataclass(frozen=True, slots=True)
class Gathered:
    """What the end of a round brought.

    Attributes:
        mix: what to do with it.
        waited: time spent waiting [s].
    """

    mix: Mix
    waited: float


@dataclass(slots=True)
class Published:
    """What the round under way sends."""

    round: int
    body: Body
    norm: float
    limit: float | None


class Exchange:
    """One agent's side of the swarm's exchange; a context manager.

    Args:
        session: an open session.
        keys: the swarm's keys.
        machine: the protocol.
        layout: what the vectors mean.
        codec: their encoding.
        roster: who is present, and in which life.
        waits: whether a slow neighbour may hold this agent up, rather than miss a message.
        shared_memory: whether large bodies may go through /dev/shm.
        last: number of the swarm's last round, or what can be learned in it [rounds] where nobody
            waits; who claims more lies.

    Attributes:
        guard: counts what was refused and shuts senders out.
        handover: what joiners are given.
        dispatch: by which parameters leave.
        on_wait: called now and then during a long wait, for a watchdog.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        machine: Machine,
        layout: Layout,
        codec: Codec,
        roster: Roster,
        waits: bool = True,
        shared_memory: bool = True,
        last: float = math.inf,
    ) -> None:
        self._resources = ExitStack()
        self.machine, self._inbox = machine, Inbox(machine)
        reception = Reception(
            machine.agent, machine.members, layout, codec, roster, self._inbox,
            last=last if waits else math.inf, most=0.0 if waits else last,
        )  # fmt: skip
        self._joins: Callable[[str], None] = lambda _agent: None
        reception.on_note = self._on_note
        transport = ZenohTransport(session, keys, machine.agent, reception.refuse)
        self.links = self._resources.enter_context(
            Links(transport, machine.agent, machine.life, reception, shared_memory)
        )
        self.dispatch = Dispatch(self.links, together=waits)
        self.handover = Handover(
            session, keys, machine.agent, plain(layout), reception, self.links, self._sign,
            self._call_on_join,
        )  # fmt: skip
        self.guard = reception.guard
        self._reception, self._roster = reception, roster
        self._out: Published | None = None
        self._taken: dict[str, Delivery] = {}
        self._said: dict[str, float] = {}  # when the last line about each cause was written [s]
        self._began = time.monotonic()  # [s]
        self._waits = waits
        self.on_wait: Callable[[], None] = lambda: None
        roster.call_on_change(self._on_presence)
        self._on_presence()

    def _on_presence(self) -> None:
        lives = self._roster.present()
        own = self._roster.incarnation(self.machine.agent) or self.machine.life
        with self._inbox.lock:
            self.machine.present(time.monotonic(), lives, own)
        self._inbox.wake()

    def heard(self) -> dict[str, tuple[int, float]]:
        """Newest round of every sender and the age of its last sign of life [s]."""
        return self._inbox.ages()

    @property
    def one_sided(self) -> int:
        """Uses of an edge that only one end made, so far."""
        with self._inbox.lock:
            accounts = [(peer.account, peer.view) for peer in self.machine.peers.values()]
            if self._waits:
                return sum(account.one_sided for account, _ in accounts)
            stated = (
                (account.uses, view.neighbours.get(self.machine.agent))
                for account, view in accounts
                if view is not None
            )
            return sum(abs(uses - said.uses) for uses, said in stated if said is not None)

    def start(self, round_: int, together: bool, stop: threading.Event) -> None:
        """Wait until enough of the swarm is here to begin ``round_``, or until told to stop.

        Raises:
            SupersededError: a later life of this agent has begun.
        """
        with self._inbox.lock:
            self.machine.start(time.monotonic(), round_, together)
        self._until(lambda action: isinstance(action, Begin), stop)

    def publish(
        self,
        round_: int,
        body: Body,
        norm: float = 0.0,
        learned: float = 0.0,
        limit: float | None = None,
    ) -> None:
        """Hand this round's parameters to the links; does not wait.

        Args:
            round_: the round.
            body: the encoded vector, which must not change any more.
            norm: Euclidean norm of the own vector, the measure for the neighbours'.
            learned: so far [rounds], where rounds are not common.
            limit: how long to wait for the neighbours' [s]; by default as recent rounds suggest.
        """
        self._reception.measure_by(norm)
        self._out = Published(round_, body, norm, limit)
        self.machine.learned = learned
        self._begin()

    def _begin(self) -> None:
        out = self._out
        assert out is not None
        with self._inbox.lock:
            sends = self.machine.begin(time.monotonic(), out.round, out.norm, out.limit)
        self.dispatch.prepare(sends[0].header, out.body)
        for send in sends:
            if send.vector:
                self.dispatch.send(send.to)
            else:
                self._send(send)

    def _send(self, send: Send) -> None:
        """A header alone; a round's vector has left for everybody, and links lose nothing."""
        self.dispatch.note(send.to, SENT if send.vector else BEAT, send.header)

    def _on_note(self, kind: str, header: ParameterHeader) -> None:
        """Somebody has sent a vector that may have been refused; lacks ours; or joins."""
        sender = header.agent
        if kind == SENT and self._inbox.lacks(header) and not self._moves(sender):
            self.dispatch.note([sender], WANT, self._sign())
        elif kind == WANT and sender in self.machine.nearby and not self._moves(sender):
            self.dispatch.send([sender])
        elif kind == JOIN:
            self._joins(sender)

    def _moves(self, agent: str) -> bool:
        """Whether bytes move between this agent and another, or wait for it."""
        report = self.links.report().get(agent)
        if report is not None and report.backlog:
            return True
        return time.monotonic() - self.links.moved(agent) < self.machine.timing.resend

    def _sign(self) -> ParameterHeader:
        with self._inbox.lock:
            return self.machine.sign()

    def _call_on_join(self, call: Callable[[str], None]) -> None:
        self._joins = call

    def gather(self, stop: threading.Event) -> Gathered | None:
        """Wait for the end of the round that was published; None when told to stop.

        Raises:
            SupersededError: a later life of this agent has begun.
        """
        start = time.monotonic()
        with self._inbox.lock:
            self.machine.ready(start)
        mix = self._until(lambda action: isinstance(action, Mix), stop)
        return Gathered(mix, time.monotonic() - start) if isinstance(mix, Mix) else None

    def _until(self, wanted: Callable[[Action], bool], stop: threading.Event) -> Action | None:
        """Do what the protocol says until it says something that the caller must do."""
        start = time.monotonic()
        while not stop.is_set():
            seen, now = self._inbox.count, time.monotonic()
            with self._inbox.lock:
                actions = self.machine.poll(now)
            for action in actions:
                match action:
                    case Send():
                        self._send(action)
                    case Say():
                        self._say(action.cause, action.line)
                    case End():
                        raise SupersededError(action.line)
                    case Again():
                        self._begin()
                        with self._inbox.lock:
                            self.machine.ready(time.monotonic())
                    case Await():
                        if now > start + SAY_WAITING:
                            self._say_waiting(action)
                            self.on_wait()
                        self._inbox.wait(seen, min(TICK, max(0.0, action.until - now)))
                    case _ if wanted(action):
                        return action
        return None

    def _say_waiting(self, action: Await) -> None:
        causes = [f"{what} ({who})" if who else what for who, what in action.causes.items()]
        self._say(
            "waiting", f"round {self.machine.round}: waiting for {', '.join(causes)}", logging.INFO
        )

    def _say(self, cause: str, line: str, level: int = logging.WARNING) -> None:
        """A line a minute and cause."""
        now = time.monotonic()
        if now < self._said.get(cause, -math.inf) + SAY_AGAIN or len(self._said) >= CAUSES:
            return
        self._said[cause] = now
        log.log(level, "%s", line)

    def look(self) -> dict[str, Delivery]:
        """Take what is new since the last look, without waiting.

        A message counts once, and the newest only: mixing the same parameters again and again would
        pull this agent back to them.  Rounds of different agents are not compared.
        """
        time.sleep(0)  # lets Zenoh's threads bring what has come
        with self._inbox.lock:
            newest = {n: self._newest(n) for n in self.machine.nearby}
            arrived = {
                n: found
                for n, found in newest.items()
                if found is not None and found is not self._taken.get(n)
                if self.machine.agent in found.header.neighbours
            }
            for neighbour in arrived:
                self.machine.peers[neighbour].account.count()
            if self.machine.superseded is not None:
                raise SupersededError(self.machine.superseded)
        self._taken |= arrived
        return arrived

    def newest_of(self, neighbour: str) -> Delivery | None:
        """A neighbour's newest vector, of whatever round."""
        with self._inbox.lock:
            return self._newest(neighbour)

    def _newest(self, neighbour: str) -> Delivery | None:
        vectors = self.machine.peers[neighbour].vectors
        return vectors[max(vectors)] if vectors else None

    def learned(self) -> dict[str, float]:
        """What each of the neighbours has learned, as far as is known [rounds].

        One that has been silent for ``timing.round`` is left out: nobody waits for it for ever.
        """
        oldest = time.monotonic() - self.machine.timing.round
        with self._inbox.lock:
            peers = {n: self.machine.peers[n] for n in self.machine.neighbours()}
            return {
                agent: peer.view.learned if peer.view else 0.0
                for agent, peer in peers.items()
                if max(peer.heard, self._began) > oldest
            }

    def wait_for_news(self) -> float:
        """Wait until something new can be looked at, for :data:`TICK` at most; how long [s]."""
        start = time.monotonic()
        self._inbox.wait(self._inbox.count, TICK)
        return time.monotonic() - start

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._resources.close()
