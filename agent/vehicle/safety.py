"""Whether to go on, hold or land: one pure function of what is known, and the limits it knows.

Whatever is wrong, the answer is the same: hold, and after a while land.  What is decided once is
not taken back: a flight that was broken off ends on the ground.
"""

import math
from dataclasses import dataclass
from enum import Enum


@dataclass(frozen=True)
class Timing:
    """Every wait has an end; all in seconds."""

    connect: float = 30.0  # until a heartbeat is heard
    ready: float = 90.0  # until the estimator has a position and arming is allowed
    command: float = 5.0  # until a command is answered
    retry: float = 0.7  # between two repetitions of an unanswered command
    takeoff: float = 60.0
    land: float = 120.0
    mode: float = 5.0  # until a mode is reported
    heartbeat: float = 1.0  # between two of ours
    stream: float = 0.05  # between two set points: 20 Hz
    link: float = 3.0  # without a heartbeat of the vehicle's
    telemetry: float = 1.0  # without a position
    coast: float = 0.5  # without a new velocity, before it stands still
    policy: float = 2.0  # without a new set point of the policy's, before the flight is broken off
    hold: float = 3.0  # of holding before the landing
    lost: float = 15.0  # without a heartbeat, before a landing is left to the vehicle alone


@dataclass(frozen=True)
class Limits:
    """What the agent never asks for, and where it breaks off."""

    speed: float = 3.0  # m/s, horizontal and vertical together
    height: float = 30.0  # m above the place of take-off
    fence: float = 100.0  # m from the place of take-off, horizontally
    battery: float = 0.15  # share
    margin: float = 2.0  # m beyond height or fence before the flight is broken off

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"limit {name} = {value}: expected a positive number")

    def speed_within(self, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
        """The velocity, shortened to what is allowed."""
        speed = math.sqrt(vx * vx + vy * vy + vz * vz)
        scale = min(1.0, self.speed / speed) if speed > 0 else 1.0
        return vx * scale, vy * scale, vz * scale

    def place_within(
        self, x: float, y: float, z: float, home: tuple[float, float, float]
    ) -> tuple[float, float, float]:
        """The place [m, NED], moved inside fence and height."""
        dx, dy = x - home[0], y - home[1]
        away = math.hypot(dx, dy)
        scale = min(1.0, self.fence / away) if away > 0 else 1.0
        return home[0] + dx * scale, home[1] + dy * scale, max(z, home[2] - self.height)


@dataclass(frozen=True)
class Health:
    """What is known of a flight at one moment; ages in seconds."""

    heartbeat_age: float = 0.0
    position_age: float = 0.0
    setpoint_age: float = 0.0
    estimator_ok: bool = True
    finite: bool = True  # telemetry and set points are numbers
    distance: float = 0.0  # m from the place of take-off, horizontally
    height: float = 0.0  # m above it
    battery: float | None = None  # share, None: unknown
    guided: bool = True  # the vehicle still obeys us
    held: float | None = None  # s since we hold, None: we do not


class Action(Enum):
    """What to do now."""

    FLY = "fly"
    HOLD = "hold"
    LAND = "land"


def decide(health: Health, limits: Limits, timing: Timing) -> tuple[Action, str]:
    """What to do, and why."""
    if health.held is not None:
        return (Action.LAND if health.held >= timing.hold else Action.HOLD), "held"
    reason = _wrong(health, limits, timing)
    return (Action.FLY, "") if reason is None else (Action.HOLD, reason)


def _wrong(health: Health, limits: Limits, timing: Timing) -> str | None:
    if health.heartbeat_age > timing.link:
        return f"link lost: no heartbeat for {health.heartbeat_age:.1f} s"
    if health.position_age > timing.telemetry:
        return f"telemetry stale: no position for {health.position_age:.1f} s"
    if not health.finite:
        return "a set point or a position is not a number"
    if not health.estimator_ok:
        return "the estimator reports bad health"
    if health.distance > limits.fence + limits.margin:
        return f"fence: {health.distance:.1f} m away, {limits.fence:g} m allowed"
    if health.height > limits.height + limits.margin:
        return f"fence: {health.height:.1f} m high, {limits.height:g} m allowed"
    if health.battery is not None and health.battery < limits.battery:
        return f"battery {health.battery:.0%}, {limits.battery:.0%} needed"
    if health.setpoint_age > timing.policy:
        return f"policy stale: no set point for {health.setpoint_age:.1f} s"
    if not health.guided:
        return "the vehicle has left its guided mode"
    return None
