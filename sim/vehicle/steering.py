"""What the quadrotor is to fly now: by its mode, within its limits, inside its fence.

Interface: :func:`steer`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sim.vehicle import guidance, setpoints
from sim.vehicle.control import Speeds
from sim.vehicle.dialect import mavlink
from sim.vehicle.flavours import Mode
from sim.vehicle.frames import Doubles
from sim.vehicle.parameters import Limits
from sim.vehicle.watch import wants_up

if TYPE_CHECKING:
    from sim.vehicle.autopilot import Autopilot, SetPoint

TAKEOFF_SPEED = 1.5  # m/s, PX4 MPC_TKO_SPEED
REACHED = 0.3  # m, a take-off that is this near is over


def steer(pilot: Autopilot) -> tuple[Doubles | None, Speeds]:
    """The target (8,) of this slice (see ``control``), None with the rotors off, and the speeds."""
    limits = pilot.parameters.limits
    wish = pilot.cruise or limits.cruise
    if pilot.mode is Mode.MISSION and not math.isnan(pilot.course.speed):
        wish = pilot.course.speed
    cruise = min(wish, limits.speed)
    speeds = Speeds(cruise, limits.up, limits.down)
    if not pilot.armed or (pilot.landed and not wants_up(pilot)):
        return None, speeds
    if pilot.climb is not None:
        target = pilot.hold.copy()
        target[2] = pilot.climb
        speeds = Speeds(cruise, min(TAKEOFF_SPEED, limits.up), limits.down)
        if abs(pilot.body.position[2] - pilot.climb) < REACHED:
            _end_takeoff(pilot, target)
    elif pilot.mode is Mode.GUIDED and pilot.setpoint is not None:
        target = _guided(pilot, pilot.setpoint)
        speeds = Speeds(limits.speed, limits.up, limits.down)
    elif pilot.mode is Mode.LAND:
        target = guidance.descend(pilot.hold, pilot.body, limits, pilot.home_ned)
        if pilot.sinking:
            target[5] = limits.landing
    elif pilot.mode is Mode.RETURN:
        target = guidance.go_home(pilot.course, pilot.hold, pilot.body, limits, pilot.home_ned)
    elif pilot.mode is Mode.MISSION:
        target = _fly_mission(pilot, limits)
    else:
        target = pilot.hold
    fenced = pilot.confine(target)
    if math.isnan(fenced[6]) and math.isnan(fenced[7]):
        fenced[6] = pilot.heading
    return fenced, speeds


def _end_takeoff(pilot: Autopilot, target: Doubles) -> None:
    pilot.climb = None
    if pilot.flavour.px4:
        pilot.enter(Mode.HOLD)
    pilot.hold = target


def _guided(pilot: Autopilot, setpoint: SetPoint) -> Doubles:
    """The set point; ArduPilot stands still where a velocity has become too old."""
    limits = pilot.parameters.limits
    if not setpoint.moving or pilot.flavour.px4:
        return setpoint.target
    if pilot.now - setpoint.time <= limits.setpoint_timeout:
        return setpoint.target
    pilot.hold = setpoints.hold_at(guidance.stopping_point(pilot.body, limits))
    pilot.setpoint = None
    return pilot.hold


def _fly_mission(pilot: Autopilot, limits: Limits) -> Doubles:
    around = guidance.Surroundings(
        pilot.now, limits, pilot.flavour, pilot.origin, pilot.home, pilot.home_ned
    )
    target, reached, over = guidance.fly_mission(
        pilot.course, pilot.missions, pilot.hold, pilot.body, around
    )
    for seq in reached:
        pilot.send(mavlink.MAVLink_mission_item_reached_message(seq))
    if reached:
        pilot.send(pilot.missions.current_message())
        pilot.hold = setpoints.hold_at(guidance.stopping_point(pilot.body, limits))
    if over and pilot.flavour.px4:
        pilot.enter(Mode.HOLD)
    return pilot.hold if over else target
