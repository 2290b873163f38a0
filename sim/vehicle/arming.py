"""Arming and disarming, and what forbids them.

Interface: :func:`unready`, :func:`arm`, :func:`disarm`; what they refuse they say in a STATUSTEXT.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sim.vehicle import setpoints
from sim.vehicle.dialect import mavlink
from sim.vehicle.flavours import Mode

if TYPE_CHECKING:
    from sim.vehicle.autopilot import Autopilot

OFFBOARD_RATE = 0.5  # s; PX4 arms in OFFBOARD only with set points faster than 2 Hz


@dataclass
class Sortie:
    """From arming to disarming; all times in seconds since boot."""

    armed_at: float = 0.0
    landed_at: float = 0.0  # when it was last in the air
    flown: bool = False  # it has been in the air
    barred_at: float | None = None  # since when something bars its way down


def unready(pilot: Autopilot) -> str | None:
    """What keeps the vehicle from arming, whatever its mode."""
    if not pilot.estimator:
        return "no position estimate yet"
    if pilot.battery <= pilot.parameters.limits.critical_battery:
        return f"battery {pilot.battery:.0%} too low"
    return None


def arm(pilot: Autopilot, *, force: bool = False) -> str | None:
    """Arm, by force without any check; or say why not."""
    if pilot.armed:
        return None
    reason = unready(pilot)
    if reason is None and not pilot.landed:
        reason = "not landed"
    radius = pilot.parameters.limits.fence_radius
    away = pilot.body.position - pilot.home_ned  # the home of the sortie before
    if reason is None and not pilot.flavour.px4 and 0 < radius < math.hypot(*away[0:2]):
        reason = "Vehicle breaching Circle fence"
    if reason is None and pilot.flavour.px4 and pilot.mode is Mode.GUIDED:
        reason = None if pilot.setpoint_age() <= OFFBOARD_RATE else "no offboard set points"
    if reason is None and pilot.mode in {Mode.LAND, Mode.RETURN}:
        reason = f"mode {pilot.mode.value} not armable"
    if reason is None and pilot.mode is Mode.MISSION and not pilot.missions.items:
        reason = "no mission" if pilot.flavour.px4 else "Mode requires mission"
    if reason is not None and not force:
        head = "Arming denied" if pilot.flavour.px4 else "PreArm"
        pilot.say(f"{head}: {reason}", mavlink.MAV_SEVERITY_CRITICAL)
        return reason
    pilot.armed, pilot.failsafe = True, False
    pilot.sortie = Sortie(armed_at=pilot.now)
    pilot.body.impact = 0.0
    pilot.home_ned = pilot.body.position
    pilot.hold = setpoints.hold_at(pilot.body.position)
    if pilot.mode is Mode.TAKEOFF:
        pilot.climb = float(pilot.home_ned[2]) - pilot.takeoff_height
    return None


def disarm(pilot: Autopilot, *, force: bool = False) -> bool:
    """Stop the rotors; in the air only by force."""
    if pilot.armed and not pilot.landed and not force:
        pilot.say("Disarming denied: not landed", mavlink.MAV_SEVERITY_CRITICAL)
        return False
    pilot.armed, pilot.climb = False, None
    if pilot.flavour.px4 and pilot.mode is not Mode.MISSION:
        pilot.enter(Mode.HOLD)
    return True
