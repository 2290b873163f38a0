"""A vehicle as a process: an autopilot on a link, in real time or in lockstep.

Interface: :class:`Options` and :func:`run`.

Real time: simulation time follows the wall clock times ``speed``, in slices of 20 ms; a machine
that is too slow falls behind rather than stall the link.

Lockstep: time passes only when told.  The step token is SET_POSITION_TARGET_LOCAL_NED.time_boot_ms
(which autopilots ignore): the vehicle's current time advances it by one step and is answered with
all telemetry of the step in one datagram, and with ATT_POS_MOCAP, where the vehicle really is, if
its estimates err; the time before that, a repetition after a lost datagram,
is answered with the same telemetry again; any other time is ignored.  A set point whose type_mask
ignores everything is a step without a set point.  Everything else is answered at once, without time
passing.  While nobody steps, the last telemetry is repeated once per second, so that clients find
the vehicle.
"""

import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field

from sim.vehicle.autopilot import ZURICH, Autopilot
from sim.vehicle.codec import Codec, SetPointMessage
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import PX4, Flavour
from sim.vehicle.frames import Geodetic
from sim.vehicle.links import Link, TcpLink, UdpLink
from sim.vehicle.quadrotor import SLICE, Noise, Quadrotor, Weather
from sim.vehicle.rooms import Room

LOCAL_OFFSET = 40  # PX4's simulation sends to 14540 + i from 14580 + i
GROUND_STATION = 14550
LOOPBACK = "127.0.0.1"
PATIENCE = 0.2  # s, how often a lockstep vehicle looks whether it is to end
ANNOUNCE = 1.0  # s between two repetitions while nobody steps
LAG = 0.5  # s of wall time by which a vehicle may fall behind before it lets time go


@dataclass(frozen=True)
class Options:
    """One vehicle."""

    port: int = 14540  # UDP: where companions listen; TCP: where we listen
    system: int = 1
    flavour: Flavour = PX4
    speed: float = 1.0  # simulated seconds per second
    lockstep: float | None = None  # s per step; None: real time
    tcp: bool = False
    host: str = LOOPBACK
    local_port: int | None = None  # UDP: where we listen; None: port + 40
    ground_port: int | None = GROUND_STATION  # UDP: where a ground station listens
    key: bytes | None = None  # 32 bytes: sign, and believe only what is signed
    weather: Weather = field(default_factory=Weather)
    noise: Noise = field(default_factory=Noise)
    seed: int = 0
    origin: Geodetic = ZURICH
    scene: str | None = None  # name or file of the world; None: an open field
    start: int = 0  # home is below this start pose of the scene

    def __post_init__(self) -> None:
        if not 0 < self.port < 65_536 - LOCAL_OFFSET:
            raise ValueError(f"port {self.port}: expected 1 to {65_535 - LOCAL_OFFSET}")
        if not 0 < self.system < 251:
            raise ValueError(f"system id {self.system}: expected 1 to 250")
        if not 0 < self.speed <= 100:
            raise ValueError(f"speed {self.speed}: expected more than 0, at most 100")
        if self.lockstep is not None and not SLICE <= self.lockstep <= 1.0:
            raise ValueError(f"lockstep {self.lockstep}: expected {SLICE} to 1 second per step")


def open_link(options: Options) -> UdpLink | TcpLink:
    """The link that the options describe.

    Raises:
        OSError: a port is taken, or the host is none of ours.
    """
    bind = LOOPBACK if options.host in {LOOPBACK, "localhost"} else "0.0.0.0"  # noqa: S104
    if options.tcp:
        return TcpLink((bind, options.port))
    local = options.port + LOCAL_OFFSET if options.local_port is None else options.local_port
    targets = [(options.host, options.port)]
    if options.ground_port is not None and options.lockstep is None:
        targets.append((options.host, options.ground_port))
    return UdpLink((bind, local), targets)


def run(
    options: Options,
    stop: threading.Event,
    ready: Callable[[int], None] = lambda port: None,
    room: Room | None = None,
) -> Autopilot:
    """Fly one vehicle until it is told to stop; the autopilot as it then is.

    Args:
        options: which one.
        stop: set it, and the vehicle ends within a fifth of a second.
        ready: called once, with the port it listens on.
        room: the scene of the options, where it has been loaded already.

    Raises:
        OSError: a port is taken.
        ValueError: there is no such scene or start.
    """
    if options.scene is not None and room is None:
        room = Room(options.scene, options.start)
    with closing(open_link(options)) as link:
        body = Quadrotor(
            weather=options.weather,
            noise=options.noise,
            seed=options.seed,
            world=room,
            yaw=room.home.yaw if room is not None else 0.0,
        )
        pilot = Autopilot(
            body,
            options.flavour,
            system=options.system,
            origin=options.origin,
            lockstep=options.lockstep is not None,
        )
        body.advance(None, pilot.idle_speeds)  # compiles, before anybody waits for us
        codec = Codec(options.system, pilot.component, options.key)
        ready(link.port)
        if options.lockstep is None:
            _real_time(pilot, codec, link, options.speed, stop)
        else:
            _lockstep(pilot, codec, link, options.lockstep, stop)
        return pilot


def _messages(codec: Codec, link: Link, timeout: float) -> list[Message]:
    """Valid messages, in the order they came; their senders become peers."""
    messages = []
    for peer, frames in link.receive(timeout):
        decoded = [message for f in frames if (message := codec.decode(f)) is not None]
        if decoded:
            link.welcome(peer)
        messages += decoded
    return messages


def _answer(pilot: Autopilot, codec: Codec, message: Message) -> list[bytes]:
    return [codec.encode(reply) for reply in pilot.handle(message)]


def _real_time(
    pilot: Autopilot, codec: Codec, link: Link, speed: float, stop: threading.Event
) -> None:
    due = time.monotonic()
    while not stop.is_set():
        due += SLICE / speed
        while True:
            wait = due - time.monotonic()
            for message in _messages(codec, link, wait):
                link.send(_answer(pilot, codec, message))
            if wait <= 0:
                break
        due = max(due, time.monotonic() - LAG)
        link.send([codec.encode(message) for message in pilot.advance(SLICE)])


def _truth(pilot: Autopilot) -> Message:
    place, q = pilot.body.truth
    return mavlink.MAVLink_att_pos_mocap_message(
        pilot.ms * 1000, [float(value) for value in q], *(float(value) for value in place)
    )


def _lockstep(
    pilot: Autopilot, codec: Codec, link: Link, step: float, stop: threading.Event
) -> None:
    before = -1
    telemetry = [codec.encode(message) for message in pilot.advance(0.0)]
    link.send(telemetry)
    announced = time.monotonic()
    while not stop.is_set():
        messages = _messages(codec, link, PATIENCE)
        if not messages and time.monotonic() - announced > ANNOUNCE:
            link.send(telemetry)
            announced = time.monotonic()
        for message in messages:
            if not isinstance(message, SetPointMessage):
                link.send(_answer(pilot, codec, message))
            elif message.target_system not in {0, pilot.system}:
                continue
            elif message.time_boot_ms == pilot.ms:
                before = pilot.ms
                frames = _answer(pilot, codec, message)
                telemetry = frames + [codec.encode(m) for m in pilot.advance(step)]
                if pilot.body.noise != Noise():
                    telemetry.insert(0, codec.encode(_truth(pilot)))
                link.send(telemetry)
                announced = time.monotonic()
            elif message.time_boot_ms == before:
                link.send(telemetry)
