"""An autopilot without sockets, and short ways to talk to it."""

from typing import Any

import numpy as np

from sim.vehicle.autopilot import Autopilot
from sim.vehicle.codec import Codec, SetPointMessage
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import Flavour, Mode
from sim.vehicle.quadrotor import Quadrotor

GROUND_STATION = 255, 190
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
VELOCITY_YAW, VELOCITY_RATE, POSITION_YAW = 2503, 1479, 2552
ARM, TAKEOFF, LAND, RTL, SET_MODE = 400, 22, 21, 20, 176


class Cockpit:
    """One autopilot, and what it said last."""

    def __init__(self, flavour: Flavour, **options: Any) -> None:
        self.pilot = Autopilot(Quadrotor(), flavour, **options)
        self._ours, self._its = Codec(*GROUND_STATION), Codec(self.pilot.system, 1)

    @property
    def body(self) -> Quadrotor:
        return self.pilot.body

    def tell(self, message: Message) -> list[Message]:
        """Through the codec and back, as over a link."""
        heard = self._its.decode(self._ours.encode(message))
        assert heard is not None
        return [self._back(reply) for reply in self.pilot.handle(heard)]

    def _back(self, message: Message) -> Message:
        decoded = self._ours.decode(self._its.encode(message))
        assert decoded is not None
        return decoded

    def wait(self, seconds: float) -> list[Message]:
        """Let time pass; all that was said meanwhile."""
        said = []
        for _ in range(round(seconds / 0.02)):
            said += self.pilot.advance(0.02)
        return [self._back(message) for message in said]

    def command(self, id_: int, *params: float, target: int = 1) -> int | None:
        """A COMMAND_LONG; the result that its COMMAND_ACK carries."""
        padded = [*params, *[0.0] * (7 - len(params))]
        message = mavlink.MAVLink_command_long_message(target, 1, id_, 0, *padded)
        return result_of(self.tell(message))

    def setpoint(
        self, mask: int, *, frame: int = 1, p: tuple[float, ...] = (0, 0, 0),
        v: tuple[float, ...] = (0, 0, 0), yaw: float = 0.0, rate: float = 0.0, target: int = 1,
    ) -> None:  # fmt: skip
        fields = (0, *p, *v, 0, 0, 0, yaw, rate, mask, target, 1, frame)
        self.tell(SetPointMessage._make(fields))

    def stream(self, seconds: float, mask: int, **fields: Any) -> None:
        """Set points at 10 Hz for a while."""
        for _ in range(round(seconds / 0.1)):
            self.setpoint(mask, **fields)
            self.wait(0.1)

    def enter(self, mode: Mode) -> int | None:
        number = self.pilot.flavour.custom_mode(mode)
        if self.pilot.flavour.px4:
            return self.command(SET_MODE, 1, number >> 16 & 0xFF, number >> 24)
        return self.command(SET_MODE, 1, number)

    def fly(self, height: float = 2.0) -> None:
        """Be in the air, obeying set points, at rest."""
        self.wait(6.0)
        if not self.pilot.flavour.px4:
            assert self.enter(Mode.GUIDED) == ACCEPTED
        assert self.command(ARM, 1) == ACCEPTED
        altitude = height + (self.pilot.home.altitude if self.pilot.flavour.px4 else 0)
        assert self.command(TAKEOFF, 0, 0, 0, 0, 0, 0, altitude) == ACCEPTED
        self.wait(6.0)
        if self.pilot.flavour.px4:
            self.setpoint(POSITION_YAW, p=(0, 0, -height))
            assert self.enter(Mode.GUIDED) == ACCEPTED
        assert self.pilot.mode is Mode.GUIDED
        assert np.linalg.norm(self.body.velocity) < 0.1


def result_of(replies: list[Message]) -> int | None:
    for reply in replies:
        if not isinstance(reply, tuple) and reply.get_type() == "COMMAND_ACK":
            assert (reply.target_system, reply.target_component) == GROUND_STATION
            return int(reply.result)
    return None


def kinds(messages: list[Message]) -> set[str]:
    return {type(m).__name__ if isinstance(m, tuple) else m.get_type() for m in messages}
