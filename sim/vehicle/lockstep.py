"""The other end of a lockstep vehicle: place it, step it, read where it is.

Interface: :class:`LockstepClient`.  Used where training runs with the full vehicle in the loop
(``bodies``, ``fleet``); the protocol is described in ``server``.
"""

import math
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Self

import gymnasium
import numpy as np

from sim.vehicle import server
from sim.vehicle.codec import Attitude, Codec, LocalPosition, SetPointMessage
from sim.vehicle.commands import PLACE
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.frames import euler_from_quaternion
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

    appear: float = 300.0  # until the vehicle is heard: it may have to compile
    answer: float = 0.5  # until a step is asked for again
    give_up: float = 10.0  # until the vehicle counts as dead


class VehicleState(NamedTuple):
    """Where a vehicle is after a step."""

    time_boot_ms: int
    position: tuple[float, float, float]  # m, NED
    velocity: tuple[float, float, float]  # m/s, NED
    attitude: tuple[float, float, float]  # rad: roll, pitch, yaw
    true_position: tuple[float, float, float]  # m, NED; the above are estimates
    true_attitude: tuple[float, float, float]  # rad


class VehicleLostError(gymnasium.error.Error, TimeoutError):
    """A vehicle does not answer, or its process has ended: an environment's error."""


class LockstepClient:
    """Steps one vehicle over UDP.

    Args:
        port: where it is expected to send to; 0: a free one.
        system: its system id.
        key: 32 bytes; sign, and believe only what is signed.
        timing: how long to wait.

    Attributes:
        alive: asked whether there is anybody to wait for, whenever nothing comes.

    Raises:
        VehicleLostError: the vehicle does not answer in time (every method).
        RuntimeError: it refuses (``place``).
    """

    def __init__(
        self, port: int = 0, system: int = 1, key: bytes | None = None, timing: Timing | None = None
    ) -> None:
        self.alive: Callable[[], bool] = lambda: True
        self._timing = timing or Timing()
        self._system = system
        self._codec = Codec(system, COMPANION, key)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((server.LOOPBACK, port))
        self.port: int = self._socket.getsockname()[1]
        self._peer: tuple[str, int] | None = None
        self._ms = self._token = -1  # of the newest telemetry, and of the step that was begun
        self._asked: Message = None  # the set point of that step
        self._place: LocalPosition | None = None
        self._turn: Attitude | None = None
        self._truth: Message = None  # ATT_POS_MOCAP of the step, where estimates err
        self._state: VehicleState | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
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
        self._send_set_point(TO_POSITION, x=x, y=y, z=z, yaw=yaw)
        return self.finish()

    def fly_at(self, vx: float, vy: float, vz: float, yaw: float) -> VehicleState:
        """One step at a velocity [m/s, NED] with a heading [rad]."""
        self.send_velocity(vx, vy, vz, yaw)
        return self.finish()

    def wait(self) -> VehicleState:
        """One step without a set point."""
        self._send_set_point(NEUTRAL)
        return self.finish()

    def send_velocity(self, vx: float, vy: float, vz: float, yaw: float) -> None:
        """Begin a step at a velocity [m/s, NED] with a heading [rad]; ``finish`` ends it."""
        self._send_set_point(BY_VELOCITY, vx=vx, vy=vy, vz=vz, yaw=yaw)

    def finish(self) -> VehicleState:
        """Wait until the step that was begun is over; ask again for what got lost."""
        token, end = self._token, time.monotonic() + self._timing.give_up
        while self._ms == token:
            if not self._receive(end):
                self._send(self._codec.encode(self._asked))
        assert self._state is not None
        return self._state

    def place(
        self, x: float, y: float, z: float, yaw: float, seed: int | None = None
    ) -> VehicleState:
        """Be in the air there, at rest; takes no time.  A `seed` begins gusts and noise anew."""
        luck = math.nan if seed is None else float(seed)
        result = self.command(PLACE, x, y, z, yaw, 0.0, 0.0, luck)
        if result != mavlink.MAV_RESULT_ACCEPTED:
            raise RuntimeError(f"vehicle {self._system} cannot be placed: MAV_RESULT {result}")
        state = VehicleState(
            self._ms, (x, y, z), (0.0, 0.0, 0.0), (0.0, 0.0, yaw), (x, y, z), (0.0, 0.0, yaw)
        )
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

    def _send_set_point(
        self,
        mask: int,
        x: float = 0.0,
        y: float = 0.0,
        z: float = 0.0,
        vx: float = 0.0,
        vy: float = 0.0,
        vz: float = 0.0,
        yaw: float = 0.0,
    ) -> None:
        self.connect()
        self._token = self._ms
        self._asked = SetPointMessage(
            self._ms, x, y, z, vx, vy, vz, 0.0, 0.0, 0.0, yaw, 0.0, mask, self._system, 1, LOCAL_NED
        )
        self._send(self._codec.encode(self._asked))

    def _send(self, frame: bytes) -> None:
        assert self._peer is not None
        self._socket.sendto(frame, self._peer)

    def _receive(self, end: float) -> list[Message]:
        """What one datagram holds; remembers the state in it."""
        left = end - time.monotonic()
        if left <= 0:
            raise VehicleLostError(f"vehicle {self._system} does not answer on port {self.port}")
        self._socket.settimeout(min(left, self._timing.answer))
        try:
            data, peer = self._socket.recvfrom(65_536)
        except (TimeoutError, ConnectionError):
            if not self.alive():
                raise VehicleLostError(f"the process of vehicle {self._system} has ended") from None
            return []
        messages = self._codec.decode_all(data)
        if messages and self._peer is None:
            self._peer = peer
        for message in messages:
            if isinstance(message, LocalPosition):
                self._place = message
            elif isinstance(message, Attitude):
                self._turn = message
            elif message.get_type() == "ATT_POS_MOCAP":
                self._truth = message
        place, turn = self._place, self._turn
        if place is None or turn is None or place.time_boot_ms != turn.time_boot_ms:
            return messages
        if place.time_boot_ms > self._ms:
            self._ms = place.time_boot_ms
            if not all(math.isfinite(value) for value in (*place, *turn)):
                raise RuntimeError(f"vehicle {self._system} reports numbers that are none")
            position, attitude = place[1:4], turn[1:4]
            if self._truth is not None:
                truth, self._truth = self._truth, None
                position = (truth.x, truth.y, truth.z)
                attitude = euler_from_quaternion(np.array(truth.q))
            self._state = VehicleState(
                self._ms, place[1:4], place[4:7], turn[1:4], position, attitude
            )
        return messages
