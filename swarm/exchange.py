"""Publish theta_k, gather the neighbours' theta_k: one synchronous round over Zenoh.

Interface: :meth:`Exchange.publish` does not wait; :meth:`Exchange.gather` waits until every
neighbour has answered, is gone or is out of time.  What to wait for is decided by the pure function
:func:`awaited`; Zenoh's callbacks only check, store and wake.

Rounds are logical.  A neighbour that already speaks of a later round will not answer this one, so
nobody waits for it; an agent that finds all of its neighbours ahead jumps to their round.  A
neighbour that let the deadline pass is not waited for again until it is heard.  While an answer is
outstanding the own message is sent again, at growing intervals: it may be the one that was lost.
"""

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType, TracebackType
from typing import Self

import msgspec
import zenoh

from swarm.compression import Codec, Plain
from swarm.errors import PayloadError
from swarm.keys import Keys
from swarm.payload import PROTOCOL, Layout, Message, ParameterHeader, decode, encode_header
from swarm.roster import Roster

log = logging.getLogger(__name__)
PATIENCE = 4.0  # see Timing
REMEMBERED = 32  # rounds whose duration sets the deadline
KEPT = 4  # messages kept per sender: neighbours in step are never further apart than one round


class Timing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Every wait of an agent [s].

    A round's deadline adapts: :data:`PATIENCE` times what nine of ten recent rounds needed, within
    floor and ceiling.

    Attributes:
        start: for the other agents of the file at the beginning; then it goes on without them.
        round: ceiling of the wait for the neighbours' parameters in one round.
        round_floor: its floor; a machine may stall for a moment.
        resend: until the own parameters are sent again; doubles each time.
        state: for a neighbour's newest parameters when joining.
        finish: for the neighbours' last round before leaving.
    """

    start: float = 60.0
    round: float = 30.0
    round_floor: float = 2.0
    resend: float = 0.25
    state: float = 2.0
    finish: float = 2.0


@dataclass(slots=True)
class Box:
    """What one sender has said: its newest messages by round."""

    messages: dict[int, Message] = field(default_factory=dict)
    heard: float = 0.0  # monotonic time of the newest message [s]

    def newest(self) -> int:
        """Newest round, -1 if none."""
        return max(self.messages, default=-1)

    def store(self, message: Message) -> None:
        """Keep a message; a new incarnation of the sender starts a new box."""
        lives = {other.header.incarnation for other in self.messages.values()}
        if lives and message.header.incarnation not in lives:
            self.messages.clear()
        self.messages.setdefault(message.header.round, message)
        for old in sorted(self.messages)[:-KEPT]:
            del self.messages[old]
        self.heard = time.monotonic()


@dataclass(frozen=True, slots=True)
class Gathered:
    """What a round's exchange brought.

    Attributes:
        arrived: messages of this round by neighbour.
        missing: neighbours without one.
        newest: newest message of each neighbour, of whatever round.
        ahead: newest round heard from a neighbour that has left this one behind, or None.
        waited: time spent waiting [s].
    """

    arrived: dict[str, Message]
    missing: tuple[str, ...]
    newest: dict[str, Message]
    ahead: int | None
    waited: float


def awaited(
    round_: int,
    neighbours: Collection[str],
    newest: Mapping[str, Collection[int]],
    present: Collection[str],
    late: Collection[str],
) -> set[str]:
    """Neighbours whose message of this round may still come.

    Args:
        round_: the round under way.
        neighbours: those of this round.
        newest: rounds heard from each sender.
        present: agents whose token lives.
        late: agents that let a deadline pass and have not been heard since.
    """
    return {
        agent
        for agent in neighbours
        if agent in present
        and agent not in late
        and max(newest.get(agent, ()), default=-1) < round_
    }


def deadline(durations: Collection[float], timing: Timing) -> float:
    """How long a round may take [s], given how long recent ones took from publishing on [s]."""
    if not durations:
        return timing.round
    usual = sorted(durations)[int(0.9 * (len(durations) - 1))]
    return min(max(PATIENCE * usual, timing.round_floor), timing.round)


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
    ) -> None:
        self._session, self._keys = session, keys
        self._agent, self._incarnation = me
        self._members, self._layout, self._codec, self._timing = members, layout, codec, timing
        self._boxes: dict[str, Box] = {}
        self._late: set[str] = set()
        self._round = 0
        self._published = 0.0  # monotonic time of the round's publication [s]
        self._durations: deque[float] = deque(maxlen=REMEMBERED)
        self._news = threading.Condition()
        self._rejected: Counter[str] = Counter()
        self._complained: set[tuple[str, str]] = set()
        self._outgoing: tuple[bytes, bytes] = (b"", b"")
        self._publisher = session.declare_publisher(
            keys.params(self._agent),
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.DATA,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        self._subscriber = session.declare_subscriber(keys.params(), self._receive)

    # --- in ---------------------------------------------------------------------------------

    def _receive(self, sample: zenoh.Sample) -> None:
        sender = str(sample.key_expr).rsplit("/", 1)[-1]
        try:
            attachment = sample.attachment
            message = decode(
                None if attachment is None else attachment.to_bytes(),
                sample.payload.to_bytes(),
                self._layout,
                self._codec,
            )
            sender = message.header.agent
            if sender == self._agent or sender not in self._members:
                raise PayloadError("stranger", f'"{sender}" is not another agent of this swarm')
        except PayloadError as error:
            self._reject(sender, error)
            return
        with self._news:
            self._boxes.setdefault(sender, Box()).store(message)
            if message.header.round >= self._round:
                self._late.discard(sender)
            self._news.notify_all()

    def _reject(self, sender: str, error: PayloadError) -> None:
        self._rejected[error.cause] += 1
        if (sender, error.cause) not in self._complained:
            self._complained.add((sender, error.cause))
            log.warning("dropped a message from %s (%s; said once, counted after)", sender, error)

    def wake(self) -> None:
        """Look again at who is present; for the roster's ``on_change``."""
        with self._news:
            self._news.notify_all()

    @property
    def rejected(self) -> dict[str, int]:
        """Messages refused so far, by cause."""
        return dict(self._rejected)

    def heard(self) -> dict[str, tuple[int, float]]:
        """Newest round and age of the newest message [s] of every sender."""
        now = time.monotonic()
        with self._news:
            return {agent: (box.newest(), now - box.heard) for agent, box in self._boxes.items()}

    # --- out --------------------------------------------------------------------------------

    def publish(
        self,
        round_: int,
        neighbours: tuple[str, ...],
        body: bytes,
        used: Mapping[int, Mapping[str, float]] = MappingProxyType({}),
    ) -> None:
        """Send this round's parameters; returns as soon as Zenoh has queued them."""
        header = self._header(self._layout, round_, neighbours)
        accounts = {past: dict(weights) for past, weights in used.items()}
        header = msgspec.structs.replace(header, used=accounts)
        self._outgoing = (encode_header(header), body)
        self._round, self._published = round_, time.monotonic()
        self._send()

    def _send(self) -> None:
        attachment, body = self._outgoing
        self._publisher.put(body, attachment=attachment)

    def _header(self, layout: Layout, round_: int, neighbours: tuple[str, ...]) -> ParameterHeader:
        return ParameterHeader(
            version=PROTOCOL,
            fingerprint=layout.fingerprint,
            agent=self._agent,
            incarnation=self._incarnation,
            round=round_,
            neighbours=neighbours,
        )

    # --- both -------------------------------------------------------------------------------

    def gather(
        self,
        round_: int,
        neighbours: tuple[str, ...],
        roster: Roster,
        stop: threading.Event,
        limit: float | None = None,
    ) -> Gathered:
        """Wait for the neighbours' parameters of this round.

        Args:
            round_: the round.
            neighbours: whose.
            roster: who is present.
            stop: set when the agent must end; gather then returns what it has.
            limit: how long after publishing [s]; by default :func:`deadline` of recent rounds.
        """
        start = time.monotonic()
        wait = deadline(self._durations, self._timing) if limit is None else limit
        end = max(start, self._published + wait)
        resend_at, interval = start + self._timing.resend, self._timing.resend
        with self._news:
            while True:
                rounds = {agent: self._boxes[agent].messages for agent in self._boxes}
                open_ = awaited(round_, neighbours, rounds, roster.present(), self._late)
                now = time.monotonic()
                if not open_ or stop.is_set():
                    break
                if now >= end:
                    self._late |= open_
                    log.warning(
                        "round %d: no parameters from %s within %.1f s, going on without",
                        round_,
                        ", ".join(sorted(open_)),
                        now - self._published,
                    )
                    break
                if now >= resend_at:
                    self._send()
                    interval *= 2
                    resend_at = now + interval
                self._news.wait(min(end - now, resend_at - now, 0.1))
            arrived = {
                agent: rounds[agent][round_]
                for agent in neighbours
                if agent in rounds and round_ in rounds[agent]
            }
            missing = tuple(agent for agent in neighbours if agent not in arrived)
            ahead = max((self._boxes[a].newest() for a in missing if a in self._boxes), default=-1)
            newest = self._newest(neighbours)
        now = time.monotonic()
        self._durations.append(now - self._published)
        return Gathered(arrived, missing, newest, ahead if ahead > round_ else None, now - start)

    def look(self, round_: int, neighbours: tuple[str, ...], staleness: int) -> Gathered:
        """Take what is there, without waiting: messages at most ``staleness`` rounds old."""
        with self._news:
            newest = self._newest(neighbours)
        arrived = {a: m for a, m in newest.items() if m.header.round >= round_ - staleness}
        missing = tuple(agent for agent in neighbours if agent not in arrived)
        ahead = max((m.header.round for m in newest.values()), default=-1) - staleness
        return Gathered(arrived, missing, newest, ahead if ahead > round_ else None, 0.0)

    def _newest(self, neighbours: tuple[str, ...]) -> dict[str, Message]:
        boxes = {agent: self._boxes[agent] for agent in neighbours if agent in self._boxes}
        return {agent: box.messages[box.newest()] for agent, box in boxes.items() if box.messages}

    # --- joining ----------------------------------------------------------------------------

    def serve_state(
        self, newest: Callable[[], tuple[int, tuple[str, ...], bytes]]
    ) -> "zenoh.Queryable[None]":
        """Answer joiners with (round, neighbours, plain bytes of theta) from ``newest``."""
        layout = self._state_layout()

        def answer(query: zenoh.Query) -> None:
            round_, neighbours, body = newest()
            header = encode_header(self._header(layout, round_, neighbours))
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
            if reply.ok is None or (attachment := reply.ok.attachment) is None:
                continue
            try:
                message = decode(
                    attachment.to_bytes(), reply.ok.payload.to_bytes(), layout, Plain()
                )
            except PayloadError as error:
                self._reject(str(reply.ok.key_expr).rsplit("/", 1)[-1], error)
                continue
            if message.header.agent != self._agent and (
                best is None or message.header.round > best.header.round
            ):
                best = message
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
            self._publisher.undeclare()
