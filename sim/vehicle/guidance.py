"""Where to fly by itself: stopping, landing, the way home, missions.

Each function says what to fly now, from what is known now; what must be remembered from one moment
to the next is in a :class:`Course`.
"""

import math
from dataclasses import dataclass

import numpy as np

from sim.vehicle.dialect import mavlink
from sim.vehicle.flavours import Flavour
from sim.vehicle.frames import Doubles, Geodetic, ned_from_geodetic
from sim.vehicle.missions import Item, MissionStore
from sim.vehicle.parameters import Limits
from sim.vehicle.quadrotor import Quadrotor
from sim.vehicle.setpoints import hold_at

NEAR = 0.5  # m, when a place is reached; PX4's NAV_ACC_RAD of 10 m is for the open sky
BRAKE = 2.5  # m/s^2, as airframe.toml's "brake"
FLARE = 0.4  # 1/s: a descent slows down to the landing speed as the ground comes near
NAV_LAND, NAV_TAKEOFF = mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_TAKEOFF


@dataclass
class Course:
    """How far a mission or a way home has got."""

    item: int = -1  # the mission item under way
    entered: Doubles | None = None  # (3,) where the item or the way home was begun
    since: float = math.nan  # s, when the place of the item was reached
    above: bool = False  # high enough to go home
    landing: bool = False
    lifted: bool = False  # the mission has taken off
    speed: float = math.nan  # m/s, by the mission's own order


@dataclass(frozen=True)
class Surroundings:
    """What guidance needs to know besides the vehicle's own movement."""

    now: float  # s
    limits: Limits
    flavour: Flavour
    origin: Geodetic
    home: Geodetic
    home_ned: Doubles  # (3,) [m]


def stopping_point(body: Quadrotor, limits: Limits) -> Doubles:
    """Where the vehicle comes to rest if it brakes now (3,) [m, NED]."""
    velocity = body.velocity.copy()
    speed = float(np.linalg.norm(velocity))
    if speed > limits.speed:  # a gust or a fall
        velocity *= limits.speed / speed
        speed = limits.speed
    stop: Doubles = body.position + velocity * (speed / (2 * BRAKE) + 0.15)  # 0.15 s: it lags
    return stop


def descend(hold: Doubles, body: Quadrotor, limits: Limits, home_ned: Doubles) -> Doubles:
    """Straight down; fast from afar, at the landing speed near the ground of the take-off."""
    target = hold.copy()
    height = float(home_ned[2] - body.position[2])
    target[2] = math.nan
    target[5] = min(limits.down, max(limits.landing, FLARE * height))
    return target


def go_home(
    course: Course, hold: Doubles, body: Quadrotor, limits: Limits, home_ned: Doubles
) -> Doubles:
    """Up, across, down."""
    position = body.position
    away = math.hypot(position[0] - home_ned[0], position[1] - home_ned[1])
    if away < NEAR or course.landing:
        course.landing = True
        return descend(hold_at(home_ned), body, limits, home_ned)
    if course.entered is None:
        course.entered = hold[0:3].copy()
    z = min(float(home_ned[2]) - limits.return_height, float(course.entered[2]))
    if not course.above and position[2] > z + NEAR:
        target = hold.copy()
        target[2] = z
        return target
    course.above = True
    return hold_at(np.array([home_ned[0], home_ned[1], z]))


def fly_mission(
    course: Course, missions: MissionStore, hold: Doubles, body: Quadrotor, around: Surroundings
) -> tuple[Doubles, list[int], bool]:
    """What to fly now, the items that were reached by now, and whether the mission is over."""
    reached: list[int] = []
    if missions.changed:
        missions.changed = False
        course.item = -1
    if not around.flavour.px4 and missions.current == 0:
        missions.current = 1  # ArduPilot keeps home in item 0
    for _ in range(len(missions.items) + 1):
        if missions.current >= len(missions.items):
            missions.current = max(0, len(missions.items) - 1)
            return hold, reached, True
        item = missions.items[missions.current]
        if course.item != missions.current:
            course.item, course.since, course.landing = missions.current, math.nan, False
            course.entered = body.position
        target = _fly(item, course, hold, body, around)
        if target is not None:
            return target, reached, False
        reached.append(missions.current)
        missions.current += 1
    return hold, reached, True


def _fly(
    item: Item, course: Course, hold: Doubles, body: Quadrotor, around: Surroundings
) -> Doubles | None:
    """What to fly for one item; None when it is done."""
    here, start = body.position, course.entered
    assert start is not None
    if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
        course.speed = item.params[1] if item.params[1] > 0 else math.nan
        return None
    if not course.lifted:
        height = around.limits.takeoff_height
        if item.command == NAV_TAKEOFF:
            height = item.place(around.home).altitude - around.home.altitude
        z = float(around.home_ned[2]) - max(height, 0.5)
        if abs(here[2] - z) > NEAR and (body.on_ground or item.command == NAV_TAKEOFF):
            return hold_at(np.array([start[0], start[1], z]))
        if abs(here[2] - z) > NEAR and here[2] > z:
            return hold_at(np.array([start[0], start[1], z]))
        course.lifted = True
    if item.command == NAV_TAKEOFF:
        return None
    if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
        return go_home(course, hold_at(start), body, around.limits, around.home_ned)
    if item.command == mavlink.MAV_CMD_NAV_DELAY:
        place = hold_at(start)
    else:
        place = hold_at(np.array(ned_from_geodetic(around.origin, item.place(around.home))))
        yaw = item.params[3]
        if around.flavour.px4 and math.isfinite(yaw):
            place[6] = math.radians(yaw % 360.0)
    if item.command == NAV_LAND:
        place[2] = start[2]
        if course.landing or math.hypot(here[0] - place[0], here[1] - place[1]) < NEAR:
            course.landing = True
            return descend(place, body, around.limits, around.home_ned)
        return place
    radius = item.params[1] if 0 < item.params[1] < 100 else NEAR
    if math.isnan(course.since) and float(np.linalg.norm(here - place[0:3])) < max(radius, 0.2):
        course.since = around.now
    stay = item.params[0] if item.params[0] > 0 else 0.0
    if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
        stay = math.inf
    return None if around.now - course.since >= stay else place
