"""Publish theta_k, gather the neighbours' theta_k: one synchronous round over Zenoh.

Interface: :meth:`Exchange.publish` does not wait; :meth:`Exchange.gather` waits until every
neighbour has answered, is gone or is out of time (:mod:`swarm.timing` decides);
:meth:`Exchange.look` takes what is there.  Zenoh's callbacks only check, store and wake.

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
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType, TracebackType
from typing import Self

import zenoh

from swarm.compression import Body, Codec, Plain
from swarm.errors import PayloadError
from swarm.guard import Guard
from swarm.inbox import Inbox
from swarm.keys import Keys
from swarm.parcels import Parcels, unwrap
from swarm.payload import (
    PROTOCOL,
    Layout,
    Message,
    ParameterHeader,
    check_norm,
    decode_body,
    decode_header,
    encode_header,
)
from swarm.roster import Roster
from swarm.timing import Timing, awaited, deadline, elsewhere, out_of_time, strangers

log = logging.getLogger(__name__)
NORM_FACTOR = 100.0  # times the own norm, or 1, is as large as a neighbour's may be
REMEMBERED = 32  # rounds whose duration sets the deadline
TICK = 0.1  # [s] at most until a wait notices that it must end
Used = Mapping[int, Mapping[str, float]]


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
        self._session, self._keys = session, keys
        self._agent, self._incarnation = me
        self._members, self._layout, self._codec, self._timing = members, layout, codec, timing
        self._inbox, self._roster = Inbox(), roster
        self._longest = math.inf  # norm of a neighbour's parameters; not known before the own
        self._last, self._most = (last, 0.0) if waits else (math.inf, last)
        self._late: set[str] = set()
        self._answered: dict[str, ParameterHeader] = {}  # header of a stranger that we answered
        self._taken: dict[str, Message] = {}
        self._waits = waits
        self._began = time.monotonic()  # [s]
        self._sent: dict[str, float] = {}  # monotonic time of the last message to each [s]
        self._guard = Guard()
        self._parcels = Parcels(shared_memory)
        self._outgoing: tuple[bytes, zenoh.ZBytes] = (b"", zenoh.ZBytes(b""))
        self._nearby: tuple[str, ...] = ()
        self._published = 0.0  # monotonic time of the round's publication [s]
        self._durations: deque[float] = deque(maxlen=REMEMBERED)
        roster.call_on_change(self._inbox.wake)
        self._congestion = zenoh.CongestionControl.BLOCK if waits else zenoh.CongestionControl.DROP
        self._publishers: dict[str, zenoh.Publisher] = {}
        mine = keys.params(receiver=self._agent)
        self._subscriber = session.declare_subscriber(mine, self._receive)

    # --- in ---------------------------------------------------------------------------------

    def _receive(self, sample: zenoh.Sample) -> None:
        _, sender = Keys.identity(str(sample.key_expr))
        if not self._guard.admits(sender):
            return
        try:
            header = self._read_header(sample.attachment, self._layout)
            self._check_sender(header, sender)
            if len(sample.payload) == 0:
                self._inbox.touch(header)
                return
            body = unwrap(sample.payload)
            vector = decode_body(body, self._layout, self._codec, self._longest)
        except PayloadError as error:
            self._guard.reject(sender, error)
        else:
            self._inbox.store(Message(header, vector))

    def _read_header(self, attachment: zenoh.ZBytes | None, layout: Layout) -> ParameterHeader:
        raw = None if attachment is None else attachment.to_bytes()
        return decode_header(raw, layout, self._last, self._most)

    def _check_sender(self, header: ParameterHeader, sender: str) -> None:
        """The header must name another member in its present life, and the key the same one.

        Access control proves the key, so the header may not say otherwise.  (Zenoh can deliver a
        sample under another sender's key after a link was lost; with wildcard subscriptions that
        is one in a million, and the sender says it again.)
        """
        if header.agent != sender:
            raise PayloadError("key", f'"{header.agent}" speaks under the key of "{sender}"')
        if header.agent == self._agent or header.agent not in self._members:
            raise PayloadError("stranger", f'"{header.agent}" is not another agent of this swarm')
        known = self._roster.incarnation(header.agent)
        if known not in {None, header.incarnation}:  # its first message may overtake its token
            raise PayloadError(
                "incarnation",
                f"{header.agent} in its life {header.incarnation}: expected {known}",
            )

    @property
    def rejected(self) -> dict[str, int]:
        """Messages refused so far, by cause."""
        return self._guard.counts

    @property
    def quarantined(self) -> tuple[str, ...]:
        """Senders that are shut out now."""
        return self._guard.quarantined()

    def heard(self) -> dict[str, tuple[int, float]]:
        """Newest round of every sender and the age of its last sign of life [s]."""
        now, rounds = time.monotonic(), self._inbox.rounds()
        return {agent: (rounds[agent], now - at) for agent, at in self._inbox.heard().items()}

    # --- out --------------------------------------------------------------------------------

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
        first, self._longest = math.isinf(self._longest), NORM_FACTOR * max(norm, 1.0)
        if first:
            self._measure()
        header = self._header(self._layout, round_, neighbours, used, learned)
        self._outgoing, self._nearby = (encode_header(header), self._parcels.wrap(body)), neighbours
        self._published = time.monotonic()
        self._send()

    def _measure(self) -> None:
        """Hold what came before the own norm was known against it."""
        for message in self._inbox.everything():
            try:
                check_norm(message.vector, self._longest)
            except PayloadError as error:
                self._inbox.forget(message)
                self._guard.reject(message.header.agent, error)

    def _send(self) -> None:
        attachment, body = self._outgoing
        for neighbour in self._nearby if self._waits else self._listening():
            self._to(neighbour).put(body, attachment=attachment)

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

    def _beat(self) -> None:
        for neighbour in self._nearby:
            self._to(neighbour).put(b"", attachment=self._outgoing[0])

    def _to(self, neighbour: str) -> zenoh.Publisher:
        if neighbour not in self._publishers:
            self._publishers[neighbour] = self._session.declare_publisher(
                self._keys.params(self._agent, neighbour),
                congestion_control=self._congestion,
                priority=zenoh.Priority.DATA,
            )
        return self._publishers[neighbour]

    def _header(
        self,
        layout: Layout,
        round_: int,
        neighbours: tuple[str, ...],
        used: Used = MappingProxyType({}),
        learned: float = 0.0,
    ) -> ParameterHeader:
        return ParameterHeader(
            version=PROTOCOL,
            fingerprint=layout.fingerprint,
            agent=self._agent,
            incarnation=self._incarnation,
            round=round_,
            neighbours=neighbours,
            used={past: dict(weights) for past, weights in used.items()},
            learned=learned,
        )

    # --- both -------------------------------------------------------------------------------

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
                self._beat()
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
                self._to(header.agent).put(b"", attachment=self._outgoing[0])

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

    # --- joining ----------------------------------------------------------------------------

    def serve_state(
        self, newest: Callable[[], tuple[int, float, tuple[str, ...], bytes]]
    ) -> "zenoh.Queryable[None]":
        """Answer joiners with (round, learned, neighbours, bytes of theta) from ``newest``."""
        layout = self._state_layout()

        def answer(query: zenoh.Query) -> None:
            round_, learned, neighbours, body = newest()
            header = encode_header(self._header(layout, round_, neighbours, learned=learned))
            query.reply(self._keys.state(self._agent), body, attachment=header)

        return self._session.declare_queryable(self._keys.state(self._agent), answer)

    def fetch_state(self) -> Message | None:
        """The newest parameters that anybody present has, or None when nobody answers in time."""
        layout, best = self._state_layout(), None
        for reply in self._session.get(
            self._keys.state(),
            timeout=self._timing.state,
            consolidation=zenoh.ConsolidationMode.NONE,
        ):
            if reply.ok is None:
                continue
            _, sender = Keys.identity(str(reply.ok.key_expr))
            try:
                header = self._read_header(reply.ok.attachment, layout)
                if header.agent != sender:
                    raise PayloadError("key", f'"{header.agent}" answers as "{sender}"')
                vector = decode_body(reply.ok.payload.to_bytes(), layout, Plain())
            except PayloadError as error:
                self._guard.reject(sender, error)
                continue
            if header.agent != self._agent and (
                best is None or _reach(header) > _reach(best.header)
            ):
                best = Message(header, vector)
        return best

    def _state_layout(self) -> Layout:
        return replace(self._layout, copies=1, codec="none")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        if not self._session.is_closed():
            self._subscriber.undeclare()
            for publisher in self._publishers.values():
                publisher.undeclare()


def _reach(header: ParameterHeader) -> tuple[float, int]:
    """How far a sender has come: what it has learned, or, where rounds are common, its round."""
    return header.learned, header.round
