"""Who may act when: one pure function of what is known, and the limits it knows.

===========================  ==================  ================================================
the mode that is reported    all is well         link, telemetry, fence, battery, estimator, policy
===========================  ==================  ================================================
ours: we asked for it        FLY                 HOLD, after ``timing.hold`` LAND
a person's: nobody of us     SILENT              SILENT
  asked for it
the autopilot's failsafe     SILENT              SILENT
the same, holding or         HOLD, then LAND     HOLD, then LAND
  wanting sticks, after our
  set points had stopped
===========================  ==================  ================================================

Silent means: no mode is asked for, no set point moves the drone, and it is said once who flies.
When the guided mode is chosen again, by whoever took it away, set points are obeyed again.  What a
person chose is never overridden, whatever is wrong.

Of what is wrong itself: the answer is always to hold, and after a while to land.  It is not taken
back: a flight that was broken off ends on the ground.
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
    working: float = 60.0  # the same, while it says that it is in progress
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
    gap: float = 1.0  # without heartbeat or tick, after which set points count as interrupted
    blame: float = 10.0  # for so long after a gap a failsafe counts as our doing
    pilot: float = 1800.0  # that a person may fly before we stop waiting for the drone
    tell: float = 60.0  # between two words while we wait for it


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


class Chosen(Enum):
    """Who chose the mode that the vehicle reports."""

    BY_US = "by us"
    BY_A_PERSON = "by a person"
    BY_FAILSAFE = "by the autopilot's failsafe"
    FOR_WANT_OF_US = "by the autopilot's failsafe, for want of our set points"


@dataclass(frozen=True)
class Health:
    """What is known of a flight at one moment; ages in seconds."""

    heartbeat_age: float = 0.0
    position_age: float = 0.0
    attitude_age: float = 0.0
    setpoint_age: float = 0.0
    estimator_ok: bool = True
    finite: bool = True  # set points are numbers
    unusable: str = ""  # telemetry that was no number, and has been for as long as it is old
    jump: float = 0.0  # m, of the estimated position, lately
    restarted: bool = False  # the autopilot, in flight
    distance: float = 0.0  # m from the place of take-off, horizontally
    height: float = 0.0  # m above it
    battery: float | None = None  # share, None: unknown
    chosen: Chosen = Chosen.BY_US
    mode: str = ""  # what pilots call the mode that is reported
    held: float | None = None  # s since we hold, None: we do not


class Action(Enum):
    """What to do now."""

    FLY = "fly"
    HOLD = "hold"
    LAND = "land"
    SILENT = "silent"


def decide(health: Health, limits: Limits, timing: Timing) -> tuple[Action, str]:
    """What to do, and why."""
    if health.chosen in {Chosen.BY_A_PERSON, Chosen.BY_FAILSAFE}:
        return Action.SILENT, f"{health.mode}, chosen {health.chosen.value}"
    if health.held is not None:
        return (Action.LAND if health.held >= timing.hold else Action.HOLD), "held"
    reason = _wrong(health, limits, timing)
    return (Action.FLY, "") if reason is None else (Action.HOLD, reason)


def _wrong(health: Health, limits: Limits, timing: Timing) -> str | None:
    if health.heartbeat_age > timing.link:
        return f"link lost: no heartbeat for {health.heartbeat_age:.1f} s"
    because = f" ({health.unusable})" if health.unusable else ""
    if health.position_age > timing.telemetry:
        return f"telemetry stale: no position for {health.position_age:.1f} s{because}"
    if health.attitude_age > timing.telemetry:
        return f"telemetry stale: no attitude for {health.attitude_age:.1f} s{because}"
    if not health.finite:
        return "a set point is not a number"
    if health.restarted:
        return "the autopilot has restarted"
    if not health.estimator_ok:
        return "the estimator reports bad health"
    if health.jump:
        return f"the estimator has jumped by {health.jump:.1f} m"
    if health.distance > limits.fence + limits.margin:
        return f"fence: {health.distance:.1f} m away, {limits.fence:g} m allowed"
    if health.height > limits.height + limits.margin:
        return f"fence: {health.height:.1f} m high, {limits.height:g} m allowed"
    if health.battery is not None and health.battery < limits.battery:
        return f"battery {health.battery:.0%}, {limits.battery:.0%} needed"
    if health.setpoint_age > timing.policy:
        return f"policy stale: no set point for {health.setpoint_age:.1f} s"
    if health.chosen is Chosen.FOR_WANT_OF_US:
        return f"{health.mode}, chosen {health.chosen.value}"
    return None
