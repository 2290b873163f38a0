"""What goes to the vehicle now: the caller's set point, standing still, or what safety insists on.

Interface: :class:`Helm`.  It decides, twenty times a second and without input or output of its own;
``vehicle`` asks it and sends.  A set point is streamed as it is; a velocity that has not been
renewed for ``timing.coast`` becomes standing still; and where ``safety.decide`` says so, the
vehicle is asked, until it obeys, to hold and then to land.
"""

import logging
import math
from typing import NamedTuple

from agent.vehicle.dialects import Dialect, Mode, mavlink
from agent.vehicle.safety import Action, Health, Limits, Timing, decide
from agent.vehicle.state import VehicleState

log = logging.getLogger(__name__)

LOCAL_NED, BODY_NED = mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_NED
POSITION_YAW, VELOCITY_YAW, VELOCITY_RATE = 2552, 2503, 1479  # type_mask
FARTHEST = 1e6  # m or m/s; beyond it a number is nonsense


class SetPoint(NamedTuple):
    """The fields of SET_POSITION_TARGET_LOCAL_NED that are in use."""

    frame: int
    mask: int
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m/s
    yaw: float = 0.0  # rad
    turn: float = 0.0  # rad/s


STAND_STILL = SetPoint(LOCAL_NED, VELOCITY_RATE)


class Helm:
    """The set point, and whether it may still be flown.

    Attributes:
        home: where the vehicle took off [m, local NED]; fence and height count from here.
        broken: why the flight was broken off; None while all is well.
    """

    def __init__(self, limits: Limits, timing: Timing, name: str) -> None:
        self._limits, self._timing, self._name = limits, timing, name
        self.home = (0.0, 0.0, 0.0)
        self.broken: str | None = None
        self._setpoint: SetPoint | None = None
        self._since = -math.inf  # when it came
        self._finite = True
        self._obeyed = False  # the vehicle flies our set points: watch that it stays so
        self._held_since: float | None = None
        self._insisted: tuple[Mode, float] | None = None  # on what, and when

    @property
    def steering(self) -> bool:
        """Whether set points are streamed."""
        return self._setpoint is not None

    def begin(self, setpoint: SetPoint, now: float) -> None:
        """Start to stream; ``obeyed`` says when the vehicle follows."""
        self._obeyed, self._finite = False, True
        self._held_since = self._insisted = self.broken = None
        self.wish(setpoint, now)

    def obeyed(self) -> None:
        """The vehicle flies our set points from now on."""
        self._obeyed = True

    def release(self) -> None:
        """Stream no more."""
        self._obeyed, self._setpoint, self._insisted = False, None, None

    def wish(self, setpoint: SetPoint, now: float) -> None:
        """Fly this; numbers that are none are not flown, and end the flight."""
        numbers = (*setpoint.place, *setpoint.velocity, setpoint.yaw, setpoint.turn)
        if not all(abs(number) <= FARTHEST for number in numbers):  # also where one is NaN
            self._finite = False
            return
        self._setpoint, self._since = setpoint, now

    def tick(self, state: VehicleState, dialect: Dialect, now: float) -> SetPoint | Mode | None:
        """What to send now: a set point, a mode to ask for, or nothing."""
        if self._setpoint is None:
            return None
        action, reason = Action.FLY, ""
        if self._obeyed or self._held_since is not None:
            health = self._health(state, dialect, now)
            action, reason = decide(health, self._limits, self._timing)
        if action is Action.FLY:
            moves = self._setpoint.mask != POSITION_YAW
            idle = moves and now - self._since > self._timing.coast
            return STAND_STILL if idle else self._setpoint
        if self._held_since is None:
            log.error("%s: %s: holding, then landing", self._name, reason)
            self._held_since, self.broken = now, reason
        return self._insist(
            dialect.land if action is Action.LAND else dialect.hold, state, dialect, now
        )

    def _insist(self, mode: Mode, state: VehicleState, dialect: Dialect, now: float) -> Mode | None:
        """Ask again and again, until the mode is reported or the vehicle is down."""
        if not state.armed or state.custom_mode == dialect.custom_mode(mode):
            return None
        if self._insisted is not None:
            before, when = self._insisted
            if before == mode and now - when < self._timing.retry:
                return None
        self._insisted = mode, now
        return mode

    def _health(self, state: VehicleState, dialect: Dialect, now: float) -> Health:
        x, y, z = state.position
        guided = state.armed and state.custom_mode == dialect.custom_mode(dialect.guided)
        return Health(
            heartbeat_age=now - state.heartbeat_at,
            position_age=now - state.position_at,
            setpoint_age=now - self._since,
            estimator_ok=state.estimator_ok,
            finite=self._finite and all(map(math.isfinite, (x, y, z, *state.velocity))),
            distance=math.hypot(x - self.home[0], y - self.home[1]),
            height=self.home[2] - z,
            battery=state.battery,
            guided=guided,
            held=None if self._held_since is None else now - self._held_since,
        )
