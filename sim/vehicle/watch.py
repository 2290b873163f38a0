"""What the autopilot looks after by itself, fifty times a second.

Interface: :func:`watch`.  A crash, an empty battery, set points that stop coming, and disarming
after a landing, on the ground or on whatever bars the way down.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sim.vehicle.arming import disarm
from sim.vehicle.dialect import mavlink
from sim.vehicle.flavours import POSITION_CONTROL, Mode

if TYPE_CHECKING:
    from sim.vehicle.autopilot import Autopilot

CRASH = 3.0  # m/s; a harder touch ends the flight.  A guess
BARRED = 2.0  # s without getting further down, after which it rests on something.  A guess
RISE = 0.3  # m above itself: a set point that leads off the ground


def watch(pilot: Autopilot) -> None:
    """See whether all is well, and act where it is not."""
    if not pilot.armed:
        return
    limits = pilot.parameters.limits
    if pilot.body.impact > CRASH:
        pilot.say("Crash: disarming", mavlink.MAV_SEVERITY_EMERGENCY)
        pilot.failsafe = True
        disarm(pilot, force=True)
        return
    if _down(pilot):
        disarm(pilot, force=True)
        return
    if pilot.battery <= limits.critical_battery and pilot.mode is not Mode.LAND:
        pilot.say("Critical battery: landing", mavlink.MAV_SEVERITY_EMERGENCY)
        pilot.failsafe = True
        pilot.enter(Mode.LAND)
    offboard = pilot.mode is Mode.GUIDED and pilot.flavour.px4
    if offboard and pilot.setpoint_age() > limits.setpoint_timeout:
        pilot.say("Offboard set points lost", mavlink.MAV_SEVERITY_CRITICAL)
        action = int(pilot.parameters["COM_OBL_RC_ACT"])
        if action == 0:  # position control, without sticks: it sinks
            pilot.say("Failsafe activated", mavlink.MAV_SEVERITY_CRITICAL)
            pilot.failsafe = True
            pilot.enter(Mode.LAND)
            pilot.custom_mode = POSITION_CONTROL
        else:
            pilot.enter({3: Mode.RETURN, 4: Mode.LAND}.get(action, Mode.HOLD))
    _fence(pilot)


def _fence(pilot: Autopilot) -> None:
    """PX4 flies what it is told up to the fence around home, and holds once it is beyond."""
    radius = pilot.parameters.limits.fence_radius
    north, east = (pilot.body.position - pilot.home_ned)[0:2]
    if not pilot.flavour.px4 or radius <= 0 or math.hypot(north, east) <= radius:
        return
    if pilot.mode in {Mode.HOLD, Mode.RETURN, Mode.LAND}:
        return
    pilot.say("Geofence: exceeding maximum distance to Home", mavlink.MAV_SEVERITY_CRITICAL)
    pilot.say("Failsafe activated", mavlink.MAV_SEVERITY_CRITICAL)
    pilot.failsafe = True
    pilot.enter(Mode.HOLD)


def _down(pilot: Autopilot) -> bool:
    """Whether it has been down for long enough to disarm; says why."""
    sortie, now = pilot.sortie, pilot.now
    if not pilot.landed:
        sortie.flown, sortie.landed_at = True, now
        return _rests(pilot)
    if pilot.climb is not None or wants_up(pilot):
        return False
    limits = pilot.parameters.limits
    waited = now - (sortie.landed_at if sortie.flown else sortie.armed_at)
    coming_down = sortie.flown and pilot.mode in {Mode.LAND, Mode.RETURN, Mode.MISSION}
    patience = limits.disarm_waiting
    if sortie.flown and (coming_down or pilot.flavour.px4):
        patience = limits.disarm_landed
    if patience < 0 or waited < patience:
        return False
    pilot.say("Disarmed by landing" if sortie.flown else "Disarmed: no take-off")
    return True


def _rests(pilot: Autopilot) -> bool:
    """Whether something that is no floor has barred its way down for a while."""
    sortie = pilot.sortie
    landing = pilot.mode is Mode.LAND or pilot.course.landing
    if not landing or not pilot.body.touching:
        sortie.barred_at = None
        return False
    if sortie.barred_at is None:
        sortie.barred_at = pilot.now
    if pilot.now - sortie.barred_at < BARRED:
        return False
    pilot.say("Disarmed: rests on something", mavlink.MAV_SEVERITY_WARNING)
    return True


def wants_up(pilot: Autopilot) -> bool:
    """Whether what it flies leads off the ground."""
    if pilot.climb is not None or (pilot.mode is Mode.MISSION and not pilot.course.landing):
        return True
    if pilot.mode is not Mode.GUIDED or not pilot.flavour.px4 or pilot.setpoint is None:
        return False
    target = pilot.setpoint.target
    return bool(target[2] < pilot.body.position[2] - RISE or target[5] < -0.1)
