"""Publish theta_k, gather the neighbours' theta_k: one synchronous round over Zenoh.

Interface: :meth:`Exchange.publish` does not wait; :meth:`Exchange.gather` waits until every
neighbour has answered, is gone or is out of time (:mod:`swarm.protocol.timing` decides);
:meth:`Exchange.look` takes what is there.  What comes in is checked and kept by
:mod:`swarm.wire.reception`, what goes out leaves by :mod:`swarm.wire.dispatch`; here stands who is
sent to, who is waited for and how long.

Rounds are logical.  A neighbour that already speaks of a later round will not answer this one, so
nobody waits for it; an agent that finds its neighbours ahead jumps to their round.  A neighbour
that let the deadline pass is not waited for again until it has caught up.  While an answer is
outstanding the own message is sent again, at growing intervals: it may be the one that was lost.
Between, messages without a body say that this agent is waiting, not gone.

For a moment after somebody came or went, two agents may disagree on whether they are neighbours.
Whoever hears from an agent that it does not exchange with answers with its header, and is not
waited for.
"""

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Collection, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from types import MappingProxyType
from typing import Self

import zenoh

from swarm.mixing.compression import Body, Codec
from swarm.protocol.timing import Timing, awaited, deadline, elsewhere, out_of_time, strangers
from swarm.protocol.transfer import Handover, plain
from swarm.wire.dispatch import Dispatch, Used
from swarm.wire.keys import Keys
from swarm.wire.payload import Layout, Message, ParameterHeader
from swarm.wire.reception import Reception
from swarm.wire.roster import Roster

log = logging.getLogger(__name__)
REMEMBERED = 32  # rounds whose duration sets the deadline
TICK = 0.1  # [s] at most until a wait notices that it must end


@dataclass(frozen=True, slots=True)
class Gathered:
    """What a round's exchange brought.

    Attributes:
        arrived: messages that count for this round, by neighbour.
        missing: neighbours without one.
        newest: newest message of each neighbour, of whatever round.
        ahead: round to go on with, when the neighbours have left this one behind; else None.
        waited: time spent waiting [s].
    """

    arrived: dict[str, Message]
    missing: tuple[str, ...]
    newest: dict[str, Message]
    ahead: int | None
    waited: float


class Exchange:
    """One agent's parameters going out and its neighbours' coming in; a context manager.

    Args:
        session: an open session.
        keys: the swarm's keys.
        me: own id and incarnation.
        members: every id of the swarm file; others are strangers.
        layout: what the vectors mean.
        codec: their encoding.
        timing: the time limits.
        roster: who is present, and in which life.
        waits: whether a slow neighbour may hold this agent up, rather than miss a message.
        shared_memory: whether large bodies may go through /dev/shm.
        last: number of the swarm's last round, or what can be learned in it [rounds] where nobody
            waits; who claims more lies.

    Attributes:
        guard: counts what was refused and shuts senders out.
        handover: what joiners are given.
        dispatch: by which parameters leave.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        me: tuple[str, str],
        members: Collection[str],
        layout: Layout,
        codec: Codec,
        timing: Timing,
        roster: Roster,
        waits: bool = True,
        shared_memory: bool = True,
        last: float = math.inf,
    ) -> None:
        self._resources = ExitStack()
        reception = self._resources.enter_context(
            Reception(
                session, keys, me[0], members, layout, codec, roster,
                last=last if waits else math.inf, most=0.0 if waits else last,
            )
        )  # fmt: skip
        self.dispatch = self._resources.enter_context(
            Dispatch(session, keys, me, layout, waits, shared_memory)
        )
        self.handover = Handover(session, keys, me[0], plain(layout), reception, self.dispatch)
        self.guard = reception.guard
        self._agent, self._timing, self._roster, self._waits = me[0], timing, roster, waits
        self._reception, self._inbox = reception, reception.inbox
        self._late: set[str] = set()
        self._answered: dict[str, ParameterHeader] = {}  # header of a stranger that we answered
        self._taken: dict[str, Message] = {}
        self._began = time.monotonic()  # [s]
        self._sent: dict[str, float] = {}  # monotonic time of the last message to each [s]
        self._nearby: tuple[str, ...] = ()
        self._published = 0.0  # monotonic time of the round's publication [s]
        self._durations: deque[float] = deque(maxlen=REMEMBERED)

    def heard(self) -> dict[str, tuple[int, float]]:
        """Newest round of every sender and the age of its last sign of life [s]."""
        return self._inbox.ages()

    def publish(
        self,
        round_: int,
        neighbours: tuple[str, ...],
        body: Body,
        used: Used = MappingProxyType({}),
        norm: float = 0.0,
        learned: float = 0.0,
    ) -> None:
        """Send this round's parameters; returns as soon as Zenoh has queued them.

        Args:
            round_: the round.
            neighbours: with whom this agent exchanges in it.
            body: the encoded vector.
            used: weights that were used in the last rounds, by round and neighbour.
            norm: Euclidean norm of the own vector, the measure for the neighbours'.
            learned: so far [rounds], where rounds are not common.
        """
        self._reception.measure_by(norm)
        self.dispatch.prepare(round_, neighbours, body, used, learned)
        self._nearby, self._published = neighbours, time.monotonic()
        self._send()

    def _send(self) -> None:
        self.dispatch.send(self._nearby if self._waits else self._listening())

    def _listening(self) -> list[str]:
        """Neighbours that have spoken since they were sent something, or not for a while.

        Without common rounds this keeps messages from piling up before a slow one.
        """
        now, heard = time.monotonic(), self._inbox.heard()
        due = [
            agent
            for agent in self._nearby
            if heard.get(agent, 0.0) > self._sent.get(agent, 0.0)
            or now > self._sent.get(agent, 0.0) + self._timing.resend
        ]
        self._sent |= dict.fromkeys(due, now)
        return due

    def gather(
        self,
        round_: int,
        neighbours: tuple[str, ...],
        stop: threading.Event,
        limit: float | None = None,
    ) -> Gathered:
        """Wait for the neighbours' parameters of this round.

        Args:
            round_: the round.
            neighbours: whose.
            stop: set when the agent must end; gather then returns what it has.
            limit: how long after publishing [s]; by default what recent rounds suggest.
        """
        start = now = time.monotonic()
        limit = deadline(self._durations, self._timing) if limit is None else limit
        interval = self._timing.resend
        resend_at, beat_at = start + interval, start + self._timing.beat
        while not stop.is_set():
            seen, rounds = self._inbox.count, self._inbox.rounds()
            self._late -= {agent for agent in self._late if rounds.get(agent, -1) >= round_}
            views = self._inbox.views()
            self._tell_strangers(strangers(self._agent, round_, neighbours, views))
            not_now = self._late | elsewhere(self._agent, round_, neighbours, views)
            open_ = awaited(round_, neighbours, rounds, self._roster.present(), not_now)
            now = time.monotonic()
            silent = out_of_time(open_, self._inbox.heard(), self._published, limit, now)
            if silent:
                self._late |= silent
                log.warning(
                    "round %d: no parameters from %s within %.1f s, going on without",
                    round_,
                    ", ".join(sorted(silent)),
                    now - self._published,
                )
            if not open_ - silent or now >= self._published + self._timing.round:
                break
            if now >= resend_at:
                self._send()
                interval *= 2
                resend_at = now + interval
            elif now >= beat_at:
                self.dispatch.beat(self._nearby)
                beat_at = now + self._timing.beat
            self._inbox.wait(seen, TICK)
        arrived = self._inbox.of_round(round_, neighbours)
        missing = tuple(agent for agent in neighbours if agent not in arrived)
        newest = self._inbox.newest(neighbours)
        ahead = max((newest[a].header.round for a in missing if a in newest), default=-1)
        now = time.monotonic()
        self._durations.append(now - self._published)
        return Gathered(arrived, missing, newest, ahead if ahead > round_ else None, now - start)

    def _tell_strangers(self, headers: Iterable[ParameterHeader]) -> None:
        """Answer those who wait for this agent in vain, once each round of theirs."""
        for header in headers:
            if self._answered.get(header.agent) is not header:
                self._answered[header.agent] = header
                self.dispatch.beat([header.agent])

    def look(self, neighbours: tuple[str, ...]) -> Gathered:
        """Take what is new since the last look, without waiting.

        A message counts once, and the newest only: mixing the same parameters again and again would
        pull this agent back to them.  Rounds of different agents are not compared.
        """
        time.sleep(0)  # lets Zenoh's threads bring what has come
        newest = self._inbox.newest(neighbours)
        arrived = {a: m for a, m in newest.items() if m is not self._taken.get(a)}
        self._taken |= arrived
        missing = tuple(agent for agent in neighbours if agent not in arrived)
        return Gathered(arrived, missing, newest, None, 0.0)

    def learned(self, neighbours: Collection[str]) -> dict[str, float]:
        """What each of the ``neighbours`` has learned, as far as is known [rounds].

        One that has been silent for ``timing.round`` is left out: nobody waits for it for ever.
        """
        heard, oldest = self._inbox.heard(), time.monotonic() - self._timing.round
        learned = {view.agent: view.learned for view in self._inbox.views()}
        return {
            agent: learned.get(agent, 0.0)
            for agent in neighbours
            if heard.get(agent, self._began) > oldest
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
