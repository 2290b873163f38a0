"""What goes to the vehicle now: the caller's set point, standing still, or what safety insists on.

Interface: :class:`Helm`.  It decides, twenty times a second and without input or output of its own;
``vehicle`` asks it and sends.  A set point is streamed as it is; a velocity that has not been
renewed for ``timing.coast`` becomes standing still; and where ``safety.decide`` says so, the
vehicle is asked, until it obeys, to hold and then to land.

A mode is ours if we have asked for it, or if it is the one before until the vehicle follows.  In
any other nothing is asked for.  PX4 lets its pilot choose OFFBOARD only while set points flow, so
there standing still goes on to be streamed, which it ignores in every other mode.
"""

import logging
import math
from typing import NamedTuple

from agent.vehicle.dialects import Dialect, Mode, mavlink
from agent.vehicle.safety import Action, Chosen, Health, Limits, Timing, decide
from agent.vehicle.state import FARTHEST, VehicleState

log = logging.getLogger(__name__)

LOCAL_NED, BODY_NED = mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_NED
POSITION_YAW, VELOCITY_YAW, VELOCITY_RATE = 2552, 2503, 1479  # type_mask


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
        taken: who flies instead of us, and in which mode; None while we do.
    """

    def __init__(self, limits: Limits, timing: Timing, name: str) -> None:
        self._limits, self._timing, self._name = limits, timing, name
        self.home = (0.0, 0.0, 0.0)
        self.broken: str | None = None
        self.taken: str | None = None
        self._setpoint: SetPoint | None = None
        self._since = -math.inf  # when it came
        self._finite = True
        self._obeyed = False  # the vehicle flies our set points: watch that it stays so
        self._held_since: float | None = None
        self._insisted: tuple[Mode, float] | None = None  # on what, and when
        self._ours: set[Mode] = set()  # what may be reported without anybody else having a hand in
        self._restarts = 0  # of the autopilot, when the flight began
        self._ticked = -math.inf  # when we last said what to send
        self._gap = -math.inf  # when set points last failed to arrive, as far as we can tell

    @property
    def steering(self) -> bool:
        """Whether set points are streamed."""
        return self._setpoint is not None

    def begin(self, setpoint: SetPoint, now: float) -> None:
        """Start to stream; ``obeyed`` says when the vehicle follows."""
        self._obeyed, self._finite = False, True
        self._held_since = self._insisted = self.broken = self.taken = None
        self._ticked, self._gap = now, -math.inf
        self.wish(setpoint, now)

    def obeyed(self, state: VehicleState, dialect: Dialect) -> None:
        """The vehicle flies our set points from now on."""
        self._obeyed, self._ours, self._restarts = True, {dialect.guided}, state.restarts

    def release(self) -> None:
        """Stream no more."""
        self._obeyed, self._setpoint = False, None
        self._insisted = self._held_since = self.taken = None

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
        if now - self._ticked > self._timing.gap or now - state.heartbeat_at > 2 * self._timing.gap:
            self._gap = now
        self._ticked = now
        if self.taken is not None and self._chosen(state, dialect, now) is Chosen.BY_US:
            log.info("%s: given back: flying again", self._name)
            self.taken = self.broken = None
            self.wish(STAND_STILL, now)
        action, reason = Action.FLY, ""
        if self._obeyed:
            health = self._health(state, dialect, now)
            action, reason = decide(health, self._limits, self._timing)
        if action is Action.SILENT:
            return self._fall_silent(reason, dialect)
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

    def _fall_silent(self, who: str, dialect: Dialect) -> SetPoint | None:
        """Ask for nothing; say once who flies, and how we get to fly again."""
        if self.taken != who:
            again = dialect.name_of(dialect.guided)
            log.warning("%s: %s: silent until %s is chosen again", self._name, who, again)
            self.taken = who
            self._held_since = self._insisted = None
            self._ours = {dialect.guided}
        return STAND_STILL if dialect.stream_first else None

    def _insist(self, mode: Mode, state: VehicleState, dialect: Dialect, now: float) -> Mode | None:
        """Ask again and again, until the mode is reported or the vehicle is down."""
        if not state.armed:
            return None
        if dialect.mode(state.custom_mode) == mode:
            self._ours = {mode}
            return None
        if self._insisted is not None:
            before, when = self._insisted
            if before == mode and now - when < self._timing.retry:
                return None
        self._insisted = mode, now
        self._ours.add(mode)
        return mode

    def _chosen(self, state: VehicleState, dialect: Dialect, now: float) -> Chosen:
        """Who chose the mode that is reported."""
        mode = dialect.mode(state.custom_mode)
        if not state.armed:
            return Chosen.BY_US if self._held_since is not None else Chosen.BY_A_PERSON
        if mode in self._ours:
            return Chosen.BY_US
        if not state.failsafe:
            return Chosen.BY_A_PERSON
        if (mode in dialect.sticks or mode == dialect.hold) and (
            self._held_since is not None or now - self._gap < self._timing.blame
        ):
            return Chosen.FOR_WANT_OF_US
        return Chosen.BY_FAILSAFE

    def _health(self, state: VehicleState, dialect: Dialect, now: float) -> Health:
        x, y, z = state.position
        name = dialect.name_of(dialect.mode(state.custom_mode)) if state.armed else "disarmed"
        return Health(
            heartbeat_age=now - state.heartbeat_at,
            position_age=now - state.position_at,
            attitude_age=now - state.attitude_at,
            setpoint_age=now - self._since,
            estimator_ok=state.estimator_ok,
            finite=self._finite,
            unusable=state.unusable,
            jump=state.jump if now - state.jumped_at < self._timing.telemetry else 0.0,
            restarted=state.restarts > self._restarts,
            distance=math.hypot(x - self.home[0], y - self.home[1]),
            height=self.home[2] - z,
            battery=state.battery,
            chosen=self._chosen(state, dialect, now),
            mode=name,
            held=None if self._held_since is None else now - self._held_since,
        )
