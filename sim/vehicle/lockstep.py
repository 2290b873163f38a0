"""The other end of a lockstep vehicle: place it, step it, read where it is.

Interface: :class:`LockstepClient`, and :func:`start` for a vehicle in a process of its own.  Used
where training runs with the full vehicle in the loop; the protocol is described in ``server``.
"""

import math
import multiprocessing
import multiprocessing.synchronize
import socket
import time
from dataclasses import dataclass, replace
from types import TracebackType
from typing import NamedTuple, Self

from sim.vehicle import server
from sim.vehicle.codec import Attitude, Codec, LocalPosition, SetPointMessage
from sim.vehicle.commands import PLACE
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.setpoints import (
    ACCELERATION,
    LOCAL_NED,
    POSITION,
    VELOCITY,
    YAW,
    YAW_RATE,
)

NEUTRAL = POSITION | VELOCITY | ACCELERATION | YAW | YAW_RATE  # a step without a set point
TO_POSITION = VELOCITY | ACCELERATION | YAW_RATE
BY_VELOCITY = POSITION | ACCELERATION | YAW_RATE
COMPANION = 191  # component id, MAV_COMP_ID_ONBOARD_COMPUTER


@dataclass(frozen=True)
class Timing:
    """How long to wait [s]."""

    appear: float = 60.0  # until the vehicle is heard: it may have to compile
    answer: float = 0.5  # until a step is asked for again
    give_up: float = 10.0  # until the vehicle counts as dead


class VehicleState(NamedTuple):
    """Where a vehicle is after a step."""

    time_boot_ms: int
    position: tuple[float, float, float]  # m, NED
    velocity: tuple[float, float, float]  # m/s, NED
    attitude: tuple[float, float, float]  # rad: roll, pitch, yaw


class LockstepClient:
    """Steps one vehicle over UDP.

    Raises:
        TimeoutError: the vehicle does not answer in time (every method).
        RuntimeError: it refuses (``place``).
    """

    def __init__(
        self, port: int = 0, system: int = 1, key: bytes | None = None, timing: Timing | None = None
    ) -> None:
        self._timing = timing or Timing()
        self._system = system
        self._codec = Codec(system, COMPANION, key)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((server.LOOPBACK, port))
        self.port: int = self._socket.getsockname()[1]
        self._peer: tuple[str, int] | None = None
        self._ms = -1
        self._state: VehicleState | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the socket."""
        self._socket.close()

    def connect(self) -> VehicleState:
        """Wait until the vehicle is heard; where it is."""
        end = time.monotonic() + self._timing.appear
        while self._state is None:
            self._receive(end)
        return self._state

    def fly_to(self, x: float, y: float, z: float, yaw: float) -> VehicleState:
        """One step towards a place [m, NED] and a heading [rad]."""
        return self._step(TO_POSITION, x=x, y=y, z=z, yaw=yaw)

    def fly_at(self, vx: float, vy: float, vz: float, yaw: float) -> VehicleState:
        """One step at a velocity [m/s, NED] with a heading [rad]."""
        return self._step(BY_VELOCITY, vx=vx, vy=vy, vz=vz, yaw=yaw)

    def wait(self) -> VehicleState:
        """One step without a set point."""
        return self._step(NEUTRAL)

    def place(self, x: float, y: float, z: float, yaw: float) -> VehicleState:
        """Be in the air there, at rest; takes no time."""
        result = self.command(PLACE, x, y, z, yaw)
        if result != mavlink.MAV_RESULT_ACCEPTED:
            raise RuntimeError(f"vehicle {self._system} cannot be placed: MAV_RESULT {result}")
        state = VehicleState(self._ms, (x, y, z), (0.0, 0.0, 0.0), (0.0, 0.0, yaw))
        self._state = state
        return state

    def command(self, id_: int, *params: float) -> int:
        """Send a COMMAND_LONG; its MAV_RESULT."""
        self.connect()
        padded = [*params, *[0.0] * (7 - len(params))]
        message = mavlink.MAVLink_command_long_message(self._system, 1, id_, 0, *padded)
        end = time.monotonic() + self._timing.give_up
        while True:
            self._send(self._codec.encode(message))
            for answer in self._receive(end):
                if getattr(answer, "command", None) == id_ and answer.get_type() == "COMMAND_ACK":
                    return int(answer.result)

    def _step(
        self,
        mask: int,
        x: float = 0.0,
        y: float = 0.0,
        z: float = 0.0,
        vx: float = 0.0,
        vy: float = 0.0,
        vz: float = 0.0,
        yaw: float = 0.0,
    ) -> VehicleState:
        self.connect()
        token = self._ms
        message = SetPointMessage(
            token, x, y, z, vx, vy, vz, 0.0, 0.0, 0.0, yaw, 0.0, mask, self._system, 1, LOCAL_NED
        )
        end = time.monotonic() + self._timing.give_up
        while self._ms == token:
            self._send(self._codec.encode(message))
            self._receive(end)
        assert self._state is not None
        return self._state

    def _send(self, frame: bytes) -> None:
        assert self._peer is not None
        self._socket.sendto(frame, self._peer)

    def _receive(self, end: float) -> list[Message]:
        """What one datagram holds; remembers the state in it."""
        left = end - time.monotonic()
        if left <= 0:
            raise TimeoutError(f"vehicle {self._system} does not answer on port {self.port}")
        self._socket.settimeout(min(left, self._timing.answer))
        try:
            data, peer = self._socket.recvfrom(65_536)
        except (TimeoutError, ConnectionError):
            return []
        messages = self._codec.decode_all(data)
        if messages and self._peer is None:
            self._peer = peer
        place = turn = None
        for message in messages:
            if isinstance(message, LocalPosition):
                place = message
            elif isinstance(message, Attitude):
                turn = message
        if place is not None and turn is not None and place.time_boot_ms > self._ms:
            self._ms = place.time_boot_ms
            if not all(math.isfinite(value) for value in (*place, *turn)):
                raise RuntimeError(f"vehicle {self._system} reports numbers that are none")
            self._state = VehicleState(self._ms, place[1:4], place[4:7], turn[1:4])
        return messages


class VehicleProcess:
    """A lockstep vehicle in a process of its own, ended with ``close``."""

    def __init__(self, options: server.Options) -> None:
        context = multiprocessing.get_context("spawn")
        self._stop = context.Event()
        self._process = context.Process(
            target=_fly, args=(options, self._stop), name="vehicle", daemon=True
        )
        self._process.start()

    @property
    def pid(self) -> int | None:
        return self._process.pid

    def close(self) -> None:
        """End it; by force if it does not listen."""
        self._stop.set()
        self._process.join(5.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def start(
    options: server.Options, timing: Timing | None = None
) -> tuple[VehicleProcess, LockstepClient]:
    """Start a vehicle on free ports, and the client that is connected to it; close both."""
    client = LockstepClient(0, options.system, options.key, timing)
    step = options.lockstep or 0.4
    vehicle = VehicleProcess(
        replace(options, port=client.port, local_port=0, ground_port=None, lockstep=step)
    )
    try:
        client.connect()
    except BaseException:
        client.close()
        vehicle.close()
        raise
    return vehicle, client


def _fly(options: server.Options, stop: multiprocessing.synchronize.Event) -> None:
    """The process: ignore Ctrl-C, which is for the one that started us."""
    import signal  # noqa: PLC0415
    import threading  # noqa: PLC0415

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    flag = threading.Event()

    def watch() -> None:
        stop.wait()
        flag.set()

    threading.Thread(target=watch, daemon=True).start()
    server.run(options, flag)
