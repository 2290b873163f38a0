"""What agents tell about themselves, for anyone who watches.

Small MessagePack maps, droppable and at a bounded rate: an agent never waits for a watcher.  The
same messages, one JSON object a line, are the metrics file of the run folder, so that live views
and recordings read one format.
"""

import time
from collections.abc import Callable
from typing import Annotated, Self, TypeVar, cast

import msgspec
import zenoh

from swarm.wire.keys import Keys
from swarm.wire.links import LinkReport

RATE = 10.0  # [1/s] most round reports per agent
FLIGHT_RATE = 4.0  # [1/s] most flight samples per agent; each may carry two pictures
PICTURE = 65_536  # [bytes] most of one picture
TRACK = 256  # most places of one sample
MESSAGE = 2 * PICTURE + 65_536  # [bytes] longer ones are not even read
REACH = 1e6  # [m] no drone is farther from its origin
ROUND, FLIGHT = "round", "flight"  # last part of their keys

Metres = Annotated[float, msgspec.Meta(ge=-REACH, le=REACH)]  # refuses NaN too
Place = tuple[Metres, Metres, Metres]  # NED: north, east, down [m]
Count = Annotated[int, msgspec.Meta(ge=0)]
Picture = Annotated[bytes, msgspec.Meta(max_length=PICTURE)]
Message = TypeVar("Message", "RoundReport", "FlightSample")


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
        disagreement: largest distance to a neighbour's parameters.
        weights: W_ij by neighbour, as used (what did not count is left out).
        missing: neighbours whose message did not count.
        one_sided: edges that only one end used so far; W of the rounds until now is symmetric, and
            so doubly stochastic, on what was really exchanged while this is 0.
        sketch: :func:`swarm.mixing.consensus.sketch` of the parameters that entered the round.
        route: states on the most followed path, for tabular tasks now and then; else empty.
        distance: mean length of the flights that ended last [m], where the world tells it.
        learned: so far [rounds], in a swarm without common rounds; see
            :mod:`swarm.mixing.staleness`.
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
    one_sided: int = 0
    sketch: tuple[float, ...] = ()
    route: tuple[int, ...] = ()
    distance: float | None = None
    learned: float = 0.0


class FlightSample(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where an agent's drone is and what it sees, now and then.

    The frame is the world's: NED (x north, y east, z down), as in ``sim/indoor/geometry/mesh.py``.

    Attributes:
        agent: who.
        round: during which it flies.
        time: Unix time [s].
        flight: number of the flight, from 0; a flight ends with a crash, a landing or its limit.
        step: number of the step in the flight, from 0.
        position: where it is [m].
        yaw: its heading, clockwise from north [rad].
        action: what it did last.
        reward: what it got for that.
        distance: flown in this flight so far [m].
        track: places on the way since the last sample of this flight [m], oldest first.
        camera: what it sees: JPEG or PNG, or empty.
        depth: depth of the same picture: PNG of 16 bits, millimetres, or empty.
    """

    agent: str
    round: Count
    time: float
    flight: Count
    step: Count
    position: Place
    yaw: Annotated[float, msgspec.Meta(ge=-100.0, le=100.0)]
    action: Count
    reward: Metres
    distance: Annotated[float, msgspec.Meta(ge=0, le=REACH)]
    track: Annotated[tuple[Place, ...], msgspec.Meta(max_length=TRACK)] = ()
    camera: Picture = b""
    depth: Picture = b""


class NeighbourStatus(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Attributes:
    round: newest round heard of.
    age: seconds since that message [s]; None before the first.
    link: what the link to it carries; None before it was needed.
    """

    round: int | None = None
    age: float | None = None
    link: LinkReport | None = None


class AgentStatus(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An agent's answer to "how are you?".

    Attributes:
        agent, incarnation, pid: who answers.
        state: ``waiting`` for the swarm or for enough of it, ``learning``, ``finished``.
        run: of the experiment, in which it is.
        waiting: what it waits for at present, by agent; by ``""`` of the swarm as a whole.
        round, rounds: where it is and where it ends; without common rounds, what it has learned.
        neighbours: with whom it exchanges.
        value, distance, disagreement: of the newest report.
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
    run: str = ""
    waiting: dict[str, str] = {}
    value: float | None = None
    distance: float | None = None
    disagreement: float | None = None
    sketch: tuple[float, ...] = ()
    rejected: dict[str, int] = {}
    quarantined: tuple[str, ...] = ()
    one_sided: int = 0
    memory_mb: float = 0.0


class TelemetryPublisher:
    """Publishes what one agent tells about itself, at bounded rates, and nothing to nobody.

    A message goes out when the wall clock enters a new ``1 / RATE`` of a second: agents whose
    clocks agree report the same rounds, and who watches them compares like with like.
    """

    def __init__(self, session: zenoh.Session, keys: Keys, agent: str) -> None:
        self._reports = _publisher(session, keys.telemetry(agent, ROUND))
        self._flights = _publisher(session, keys.telemetry(agent, FLIGHT))
        self._report_slot = self._flight_slot = -1

    def due(self) -> bool:
        """Whether a report would be sent now; building one costs something."""
        return int(time.time() * RATE) != self._report_slot

    def put(self, report: RoundReport, always: bool = False) -> None:
        """Send if it is time to, or ``always`` (the last report of a run)."""
        if always or self.due():
            self._report_slot = int(time.time() * RATE)
            self._reports.put(msgspec.msgpack.encode(report))

    def flight_due(self) -> bool:
        """Whether a flight sample would be sent now: it is time to, and somebody watches."""
        if int(time.time() * FLIGHT_RATE) == self._flight_slot:
            return False
        # Zenoh 1.10 declares it a bool; it is a MatchingStatus, which is always true.
        return cast("zenoh.MatchingStatus", self._flights.matching_status).matching

    def flight(self, sample: FlightSample) -> None:
        """Send if it is :meth:`flight_due`."""
        if self.flight_due():
            self._flight_slot = int(time.time() * FLIGHT_RATE)
            self._flights.put(msgspec.msgpack.encode(sample))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._reports.undeclare()
        self._flights.undeclare()


def _publisher(session: zenoh.Session, key: str) -> zenoh.Publisher:
    return session.declare_publisher(
        key, congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.BACKGROUND
    )


def watch_reports(
    session: zenoh.Session, keys: Keys, on_report: Callable[[RoundReport], None]
) -> zenoh.Subscriber[None]:
    """Hand every report that arrives to ``on_report``, on Zenoh's thread; bad ones are dropped."""
    return _watch(session, keys.telemetry(what=ROUND), RoundReport, on_report)


def watch_flights(
    session: zenoh.Session, keys: Keys, on_sample: Callable[[FlightSample], None]
) -> zenoh.Subscriber[None]:
    """Hand every flight sample that arrives to ``on_sample``, as :func:`watch_reports` does."""
    return _watch(session, keys.telemetry(what=FLIGHT), FlightSample, on_sample)


def _watch(
    session: zenoh.Session, key: str, kind: type[Message], receive: Callable[[Message], None]
) -> zenoh.Subscriber[None]:
    def on_sample(sample: zenoh.Sample) -> None:
        message = decode(sample.payload.to_bytes(), kind)
        if message is not None and Keys.names(str(sample.key_expr), message.agent):
            receive(message)

    return session.declare_subscriber(key, on_sample)


def decode(body: bytes, kind: type[Message]) -> Message | None:
    """The message in ``body``, or None if it is none: too long, torn, of another type or range."""
    if len(body) > MESSAGE:
        return None
    try:
        return msgspec.msgpack.decode(body, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return None


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
        except (msgspec.MsgspecError, UnicodeDecodeError):
            continue
        if Keys.names(str(reply.ok.key_expr), status.agent):
            answers[status.agent] = status
    return answers
