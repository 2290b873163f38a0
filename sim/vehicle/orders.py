"""The commands that move the vehicle, or change how it flies.

Each takes the autopilot and a :class:`Command` and raises :class:`Refusal`; ``commands`` has the
table of them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sim.vehicle import setpoints
from sim.vehicle.arming import arm, disarm
from sim.vehicle.command import DENIED, Command, Refusal, place_of, require
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import Mode, px4_mode
from sim.vehicle.setpoints import ABOVE_SEA

if TYPE_CHECKING:
    from sim.vehicle.autopilot import Autopilot

UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
SEEDS = 1 << 24  # whole numbers that a float32 parameter tells apart
MAGIC_FORCE = 21196  # param2 of COMPONENT_ARM_DISARM: disarm also in the air


def arm_or_disarm(pilot: Autopilot, command: Command) -> None:
    """COMPONENT_ARM_DISARM."""
    wanted = command.whole(1)
    if wanted not in {0, 1}:
        raise Refusal(DENIED)
    if wanted:
        if arm(pilot, force=command.params[1] in pilot.flavour.force_arm) is not None:
            raise Refusal(pilot.flavour.refusal)
    elif not disarm(pilot, force=command.params[1] == MAGIC_FORCE):
        raise Refusal(pilot.flavour.refusal)


def take_off(pilot: Autopilot, command: Command) -> None:
    """NAV_TAKEOFF: to an altitude above the sea (PX4) or above home (ArduPilot)."""
    height = pilot.parameters.limits.takeoff_height
    if math.isfinite(command.z):
        if pilot.flavour.px4 and command.frame in ABOVE_SEA:
            height = command.z - pilot.home.altitude
        else:
            height = command.z
    elif not pilot.flavour.px4:
        raise Refusal(DENIED)
    require(pilot, pilot.take_off(height))


def land(pilot: Autopilot, command: Command) -> None:
    """NAV_LAND, here."""
    del command
    require(pilot, pilot.change_mode(Mode.LAND))


def go_home(pilot: Autopilot, command: Command) -> None:
    """NAV_RETURN_TO_LAUNCH."""
    del command
    require(pilot, pilot.change_mode(Mode.RETURN))


def loiter(pilot: Autopilot, command: Command) -> None:
    """NAV_LOITER_UNLIM, here."""
    del command
    require(pilot, pilot.change_mode(Mode.HOLD))


def set_mode(pilot: Autopilot, command: Command) -> None:
    """DO_SET_MODE."""
    if not command.whole(1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        raise Refusal(DENIED)
    number = command.whole(2)
    if pilot.flavour.px4:
        sub = command.whole(3)
        if not (0 <= number < 256 and 0 <= sub < 256):
            raise Refusal(DENIED)
        number = px4_mode(number, sub)
    enter(pilot, number)


def enter(pilot: Autopilot, number: int) -> None:
    """Enter the mode behind a custom_mode."""
    mode = pilot.flavour.mode(number)
    if mode is None and pilot.flavour.px4:
        return  # accepted, and nothing changes
    if mode is None:
        raise Refusal(pilot.flavour.refusal, f"No such mode {number}")
    require(pilot, pilot.change_mode(mode, number))


def reposition(pilot: Autopilot, command: Command) -> None:
    """DO_REPOSITION: hold somewhere else."""
    place = place_of(pilot, command.frame, command.x, command.y, command.z)
    if pilot.mode not in {Mode.HOLD, Mode.GUIDED} and not command.params[1] == 1:
        raise Refusal(DENIED, "reposition needs the change-mode flag")
    if command.params[0] > 0:
        pilot.cruise = command.params[0]
    yaw = command.params[3]  # rad
    target = setpoints.hold_at(place, yaw if math.isfinite(yaw) else math.nan)
    require(pilot, pilot.go_to(target))


def change_speed(pilot: Autopilot, command: Command) -> None:
    """DO_CHANGE_SPEED, for what the autopilot flies by itself."""
    speed = command.params[1]
    if speed in {-1, -2}:
        return
    if command.whole(1) not in {0, 1} or not 0 < speed <= pilot.parameters.limits.speed:
        raise Refusal(DENIED)
    pilot.cruise = speed


def turn(pilot: Autopilot, command: Command) -> None:
    """CONDITION_YAW: a heading, or a turn from here [deg]."""
    angle = command.params[0]
    if not abs(angle) <= 360:
        raise Refusal(DENIED)
    if not pilot.armed or pilot.landed:
        require(pilot, "not flying")
    if command.params[3] == 1:
        pilot.heading = pilot.body.attitude[2] + math.copysign(
            math.radians(angle), command.params[2] if command.params[2] < 0 else angle
        )
    else:
        pilot.heading = math.radians(angle)
    for target in (pilot.hold, pilot.setpoint.target if pilot.setpoint is not None else None):
        if target is not None:
            target[6:8] = math.nan


def mission_start(pilot: Autopilot, command: Command) -> None:
    """MISSION_START."""
    del command
    if pilot.flavour.px4:
        if not pilot.missions.items:
            raise Refusal(DENIED, "Mission start denied! No valid mission")
        if not pilot.armed:
            if arm(pilot) is not None:
                raise Refusal(pilot.flavour.refusal)
            pilot.say("Armed by mission start")
    require(pilot, pilot.change_mode(Mode.MISSION))


def pause(pilot: Autopilot, command: Command) -> None:
    """DO_PAUSE_CONTINUE."""
    going_on = command.whole(1) == 1
    require(pilot, pilot.change_mode(Mode.MISSION if going_on else Mode.HOLD))


def put(pilot: Autopilot, command: Command) -> None:
    """Be somewhere in the air; in lockstep only."""
    if not pilot.lockstep:
        raise Refusal(UNSUPPORTED)
    x, y, z, yaw = command.params
    limits = pilot.parameters.limits
    place = np.array([x, y, z])
    if not np.all(np.abs(place) < setpoints.FARTHEST) or not abs(yaw) < setpoints.FARTHEST:
        raise Refusal(DENIED)
    target = setpoints.hold_at(place)
    kept = setpoints.confine(
        target, place, pilot.home_ned, limits.fence_radius, limits.fence_height
    )
    if not np.allclose(kept[0:3], place):
        raise Refusal(DENIED, "beyond the fence")
    if not math.isnan(command.z):  # what is chance in the flight that begins
        if not 0 <= command.z < SEEDS:
            raise Refusal(DENIED)
        pilot.body.reseed(int(command.z))
    pilot.place(place, yaw)


def guided_item(pilot: Autopilot, message: Message) -> int:
    """A MISSION_ITEM with current = 2: fly there now, in GUIDED (dronekit); MAV_MISSION_RESULT."""
    scale = 1e-7 if message.get_type() == "MISSION_ITEM_INT" else 1.0
    try:
        place = place_of(pilot, message.frame, message.x * scale, message.y * scale, message.z)
    except Refusal:
        return int(mavlink.MAV_MISSION_INVALID)
    if pilot.mode is not Mode.GUIDED or pilot.go_to(setpoints.hold_at(place)) is not None:
        return int(mavlink.MAV_MISSION_DENIED)
    return int(mavlink.MAV_MISSION_ACCEPTED)
