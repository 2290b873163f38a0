"""What agents tell about themselves, for anyone who watches.

Small MessagePack maps, droppable and at a bounded rate: an agent never waits for a watcher.  The
same messages, one JSON object a line, are the metrics file of the run folder, so that live views
and recordings read one format.
"""

import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

import msgspec
import zenoh

from swarm.keys import Keys

RATE = 10.0  # [1/s] most telemetry messages of one kind per agent


class RoundReport(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One agent's account of one finished round.

    Attributes:
        agent: who.
        round: number of the round, from 0.
        time: Unix time at its end [s].
        seconds: wall time of the round [s].
        waited: part of it spent waiting for neighbours [s].
        value: mean discounted return of the round's episodes (exact estimator: the exact value).
        episodes: episodes flown so far.
        steps: environment steps so far.
        gradient_norm: Euclidean norm of the gradient estimate.
        distance: mean length of the flights that ended last [m], where the world tells it.
        disagreement: largest distance to a neighbour's parameters.
        weights: W_ij by neighbour, as used (what did not count is left out).
        missing: neighbours whose message did not count.
        sketch: :func:`swarm.consensus.sketch` of the parameters that entered the round.
        route: states on the most followed path, for tabular tasks now and then; else empty.
    """

    agent: str
    round: int
    time: float
    seconds: float
    waited: float
    value: float
    episodes: int
    steps: int
    gradient_norm: float
    disagreement: float
    weights: dict[str, float]
    missing: tuple[str, ...] = ()
    distance: float | None = None
    sketch: tuple[float, ...] = ()
    route: tuple[int, ...] = ()


class NeighbourStatus(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Attributes:
    round: newest round heard of.
    age: seconds since that message [s]; None before the first.
    """

    round: int | None = None
    age: float | None = None


class AgentStatus(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An agent's answer to "how are you?".

    Attributes:
        agent, incarnation, pid: who answers.
        state: ``waiting`` for the swarm, ``learning``, ``finished``.
        round, rounds: where it is and where it ends.
        neighbours: with whom it exchanges.
        value, disagreement: of the newest report.
        sketch: of its parameters.
        rejected: messages refused, by cause.
        quarantined: senders that are shut out for now.
        one_sided: edges that only one end used in a round; 0 while W is symmetric on what was
            really exchanged.
        memory_mb: resident memory [MB].
    """

    agent: str
    incarnation: str
    pid: int
    state: str
    round: int
    rounds: int
    neighbours: dict[str, NeighbourStatus]
    value: float | None = None
    disagreement: float | None = None
    sketch: tuple[float, ...] = ()
    rejected: dict[str, int] = {}
    quarantined: tuple[str, ...] = ()
    one_sided: int = 0
    memory_mb: float = 0.0


class TelemetryPublisher:
    """Publishes reports of one agent, at most :data:`RATE` a second of them.

    A report goes out when the wall clock enters a new ``1 / RATE`` of a second: agents whose clocks
    agree report the same rounds, and who watches them compares like with like.
    """

    def __init__(self, session: zenoh.Session, keys: Keys, agent: str) -> None:
        self._publisher = session.declare_publisher(
            keys.telemetry(agent, "round"),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.BACKGROUND,
        )
        self._slot = -1

    def due(self) -> bool:
        """Whether a report would be sent now; building one costs something."""
        return int(time.time() * RATE) != self._slot

    def put(self, report: RoundReport, always: bool = False) -> None:
        """Send if it is time to, or ``always`` (the last report of a run)."""
        if always or self.due():
            self._slot = int(time.time() * RATE)
            self._publisher.put(msgspec.msgpack.encode(report))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        self._publisher.undeclare()


def watch_reports(
    session: zenoh.Session, keys: Keys, on_report: Callable[[RoundReport], None]
) -> zenoh.Subscriber[None]:
    """Hand every report that arrives to ``on_report``, on Zenoh's thread; bad ones are dropped."""
    decoder = msgspec.msgpack.Decoder(RoundReport)

    def receive(sample: zenoh.Sample) -> None:
        try:
            report = decoder.decode(sample.payload.to_bytes())
        except msgspec.MsgspecError:
            return
        if report.agent == Keys.identity(str(sample.key_expr))[1]:
            on_report(report)

    return session.declare_subscriber(keys.telemetry(what="round"), receive)


def ask_status(session: zenoh.Session, keys: Keys, timeout: float) -> dict[str, AgentStatus]:
    """Ask every agent how it is; those that answer within ``timeout`` [s]."""
    decoder = msgspec.msgpack.Decoder(AgentStatus)
    answers: dict[str, AgentStatus] = {}
    for reply in session.get(
        keys.status(), timeout=timeout, consolidation=zenoh.ConsolidationMode.NONE
    ):
        if reply.ok is None:
            continue
        try:
            status = decoder.decode(reply.ok.payload.to_bytes())
        except msgspec.MsgspecError:
            continue
        if status.agent == Keys.identity(str(reply.ok.key_expr))[1]:
            answers[status.agent] = status
    return answers
