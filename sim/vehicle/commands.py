"""Commands: COMMAND_LONG and COMMAND_INT, each answered with a COMMAND_ACK, also the refusals.

Interface: :func:`run`.  UNSUPPORTED for what is unknown, DENIED for arguments that make no sense,
and the flavour's own refusal (PX4: TEMPORARILY_REJECTED, ArduPilot: FAILED) with a STATUSTEXT
where the state of the vehicle forbids it.

Source: https://mavlink.io/en/services/command.html
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim.vehicle import setpoints, telemetry
from sim.vehicle.arming import arm, disarm
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import Mode, px4_mode
from sim.vehicle.frames import Doubles, Geodetic, ned_from_geodetic
from sim.vehicle.setpoints import ABOVE_HOME, ABOVE_SEA

if TYPE_CHECKING:
    from sim.vehicle.autopilot import Autopilot

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
UNSUPPORTED_FRAME = 9  # MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME, missing from pymavlink
MAGIC_FORCE = 21196  # param2 of COMPONENT_ARM_DISARM: disarm also in the air
PLACE = mavlink.MAV_CMD_USER_1  # lockstep only: be at x, y, z [m, NED], yaw [rad], flying
FAR_INT = 0x7FFFFFFF  # COMMAND_INT's "no value" for a coordinate


class Refusal(Exception):  # noqa: N818  (an answer, not an error)
    """The command is not carried out; the result says what to answer."""

    def __init__(self, result: int, reason: str = "") -> None:
        super().__init__(reason)
        self.result = result


@dataclass(frozen=True)
class Command:
    """One command, from either message."""

    id: int
    params: tuple[float, float, float, float]
    x: float  # latitude [deg] or param5; NaN: none
    y: float  # longitude [deg] or param6; NaN: none
    z: float  # altitude [m] or param7
    frame: int
    sender: tuple[int, int]

    def whole(self, index: int) -> int:
        """A parameter (1 to 4) as an integer."""
        value = self.params[index - 1]
        if not math.isfinite(value):
            raise Refusal(DENIED)
        return int(value)


def read(message: Message) -> Command:
    """The command of a message."""
    params = (message.param1, message.param2, message.param3, message.param4)
    sender = (message.get_srcSystem(), message.get_srcComponent())
    if message.get_type() == "COMMAND_LONG":
        frame = mavlink.MAV_FRAME_GLOBAL
        x, y, z = message.param5, message.param6, message.param7
    else:
        frame = message.frame
        x = math.nan if message.x == FAR_INT else message.x * 1e-7
        y = math.nan if message.y == FAR_INT else message.y * 1e-7
        z = message.z
    return Command(message.command, params, x, y, z, frame, sender)


def run(pilot: Autopilot, message: Message) -> Message:
    """Carry a command out; the COMMAND_ACK."""
    command = read(message)
    action = ACTIONS.get(command.id)
    result = UNSUPPORTED
    if action is not None:
        try:
            action(pilot, command)
            result = ACCEPTED
        except Refusal as refusal:
            result = refusal.result
            if str(refusal):
                pilot.say(str(refusal), mavlink.MAV_SEVERITY_WARNING)
    return mavlink.MAVLink_command_ack_message(command.id, result, 0, 0, *command.sender)


def set_mode_message(pilot: Autopilot, message: Message) -> Message:
    """The older SET_MODE; answered like ArduPilot does."""
    sender = (message.get_srcSystem(), message.get_srcComponent())
    try:
        _enter(pilot, message.custom_mode)
        result = ACCEPTED
    except Refusal as refusal:
        result = refusal.result
    return mavlink.MAVLink_command_ack_message(
        mavlink.MAVLINK_MSG_ID_SET_MODE, result, 0, 0, *sender
    )


def guided_item(pilot: Autopilot, message: Message) -> int:
    """A MISSION_ITEM with current = 2: fly there now, in GUIDED (dronekit); MAV_MISSION_RESULT."""
    scale = 1e-7 if message.get_type() == "MISSION_ITEM_INT" else 1.0
    try:
        place = _place(pilot, message.frame, message.x * scale, message.y * scale, message.z)
    except Refusal:
        return int(mavlink.MAV_MISSION_INVALID)
    if pilot.mode is not Mode.GUIDED or pilot.go_to(setpoints.hold_at(place)) is not None:
        return int(mavlink.MAV_MISSION_DENIED)
    return int(mavlink.MAV_MISSION_ACCEPTED)


def _require(pilot: Autopilot, reason: str | None) -> None:
    """Refuse as the flavour does, if there is a reason."""
    if reason is not None:
        raise Refusal(pilot.flavour.refusal, reason)


def _place(pilot: Autopilot, frame: int, latitude: float, longitude: float, z: float) -> Doubles:
    """A place (3,) [m, NED]; what is NaN stays as it is."""
    here = pilot.body.position
    if frame in ABOVE_SEA:
        base = 0.0
    elif frame in ABOVE_HOME:
        base = pilot.home.altitude
    else:
        raise Refusal(UNSUPPORTED_FRAME)
    place = here.copy()
    if math.isfinite(latitude) and math.isfinite(longitude):
        if abs(latitude) > 90 or abs(longitude) > 180:
            raise Refusal(DENIED)
        target = Geodetic(latitude, longitude, 0.0)
        place[0], place[1], _ = ned_from_geodetic(pilot.origin, target)
    if math.isfinite(z):
        place[2] = pilot.origin.altitude - (z + base)
    if not np.all(np.abs(place) < setpoints.FARTHEST):
        raise Refusal(DENIED)
    return place


# -- the commands ----------------------------------------------------------------------------------


def _arm(pilot: Autopilot, command: Command) -> None:
    wanted = command.whole(1)
    if wanted not in {0, 1}:
        raise Refusal(DENIED)
    if wanted:
        if arm(pilot) is not None:  # which says why itself
            raise Refusal(pilot.flavour.refusal)
    elif not disarm(pilot, force=command.params[1] == MAGIC_FORCE):
        raise Refusal(pilot.flavour.refusal)


def _take_off(pilot: Autopilot, command: Command) -> None:
    height = pilot.parameters.limits.takeoff_height
    if math.isfinite(command.z):
        if pilot.flavour.px4 and command.frame in ABOVE_SEA:
            height = command.z - pilot.home.altitude
        else:
            height = command.z
    elif not pilot.flavour.px4:
        raise Refusal(DENIED)
    _require(pilot, pilot.take_off(height))


def _land(pilot: Autopilot, command: Command) -> None:
    del command
    _require(pilot, pilot.change_mode(Mode.LAND))


def _return(pilot: Autopilot, command: Command) -> None:
    del command
    _require(pilot, pilot.change_mode(Mode.RETURN))


def _loiter(pilot: Autopilot, command: Command) -> None:
    del command
    _require(pilot, pilot.change_mode(Mode.HOLD))


def _set_mode(pilot: Autopilot, command: Command) -> None:
    if not command.whole(1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        raise Refusal(DENIED)
    number = command.whole(2)
    if pilot.flavour.px4:
        sub = command.whole(3)
        if not (0 <= number < 256 and 0 <= sub < 256):
            raise Refusal(DENIED)
        number = px4_mode(number, sub)
    _enter(pilot, number)


def _enter(pilot: Autopilot, number: int) -> None:
    mode = pilot.flavour.mode(number)
    if mode is None:
        raise Refusal(DENIED, f"no mode {number}")
    _require(pilot, pilot.change_mode(mode, number))


def _reposition(pilot: Autopilot, command: Command) -> None:
    place = _place(pilot, command.frame, command.x, command.y, command.z)
    if pilot.mode not in {Mode.HOLD, Mode.GUIDED} and not command.params[1] == 1:
        raise Refusal(DENIED, "reposition needs the change-mode flag")
    if command.params[0] > 0:
        pilot.cruise = command.params[0]
    yaw = command.params[3]  # rad
    target = setpoints.hold_at(place, yaw if math.isfinite(yaw) else math.nan)
    _require(pilot, pilot.go_to(target))


def _change_speed(pilot: Autopilot, command: Command) -> None:
    speed = command.params[1]
    if speed in {-1, -2}:
        return
    if command.whole(1) not in {0, 1} or not 0 < speed <= pilot.parameters.limits.speed:
        raise Refusal(DENIED)
    pilot.cruise = speed


def _yaw(pilot: Autopilot, command: Command) -> None:
    angle = command.params[0]
    if not abs(angle) <= 360:
        raise Refusal(DENIED)
    if not pilot.armed or pilot.landed:
        _require(pilot, "not flying")
    if command.params[3] == 1:
        pilot.heading = pilot.body.attitude[2] + math.copysign(
            math.radians(angle), command.params[2] if command.params[2] < 0 else angle
        )
    else:
        pilot.heading = math.radians(angle)
    for target in (pilot.hold, pilot.setpoint.target if pilot.setpoint is not None else None):
        if target is not None:
            target[6:8] = math.nan


def _request_message(pilot: Autopilot, command: Command) -> None:
    _send(pilot, command.whole(1))


def _send(pilot: Autopilot, id_: int) -> None:
    if id_ not in telemetry.BUILDERS and id_ != mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
        raise Refusal(UNSUPPORTED)
    message = pilot.message(id_)
    if message is None:
        raise Refusal(pilot.flavour.refusal)
    pilot.send(message)


def _set_interval(pilot: Autopilot, command: Command) -> None:
    id_, interval = command.whole(1), command.params[1]
    if id_ not in telemetry.BUILDERS and id_ != mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
        raise Refusal(UNSUPPORTED)
    if math.isnan(interval):
        raise Refusal(DENIED)
    seconds: float | None = interval * 1e-6
    if interval < 0:
        seconds = None
    elif interval == 0:
        seconds = 1 / telemetry.RATES[id_] if id_ in telemetry.RATES else None
    pilot.streams.every(id_, seconds, pilot.now)


def _get_interval(pilot: Autopilot, command: Command) -> None:
    id_ = command.whole(1)
    period = pilot.streams.period(id_)
    micros = -1 if period is None else round(period * 1e6)
    pilot.send(mavlink.MAVLink_message_interval_message(id_ & 0xFFFF, micros))


def _mission_start(pilot: Autopilot, command: Command) -> None:
    del command
    if not pilot.armed:
        _require(pilot, "not armed")
    _require(pilot, pilot.change_mode(Mode.MISSION))


def _pause(pilot: Autopilot, command: Command) -> None:
    going_on = command.whole(1) == 1
    _require(pilot, pilot.change_mode(Mode.MISSION if going_on else Mode.HOLD))


def _set_current(pilot: Autopilot, command: Command) -> None:
    if not pilot.missions.set_current(command.whole(1)):
        raise Refusal(DENIED)


def _set_home(pilot: Autopilot, command: Command) -> None:
    if not pilot.estimator:
        _require(pilot, "no position estimate yet")
    if command.params[0] == 1:
        pilot.home_ned = pilot.body.position
    else:
        pilot.home_ned = _place(pilot, command.frame, command.x, command.y, command.z)
    _send(pilot, mavlink.MAVLINK_MSG_ID_HOME_POSITION)


def _get_home(pilot: Autopilot, command: Command) -> None:
    del command
    _send(pilot, mavlink.MAVLINK_MSG_ID_HOME_POSITION)


def _capabilities(pilot: Autopilot, command: Command) -> None:
    del command
    _send(pilot, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)


def _put(pilot: Autopilot, command: Command) -> None:
    if not pilot.lockstep:
        raise Refusal(UNSUPPORTED)
    x, y, z, yaw = command.params
    limits = pilot.parameters.limits
    place = np.array([x, y, z])
    if not np.all(np.abs(place) < setpoints.FARTHEST) or not abs(yaw) < setpoints.FARTHEST:
        raise Refusal(DENIED)
    target = setpoints.hold_at(place)
    kept = setpoints.confine(target, place, limits.fence_radius, limits.fence_height)
    if not np.allclose(kept[0:3], place):
        raise Refusal(DENIED, "beyond the fence")
    pilot.place(place, yaw)


ACTIONS: dict[int, Callable[[Autopilot, Command], None]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_NAV_TAKEOFF: _take_off,
    mavlink.MAV_CMD_NAV_LAND: _land,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: _loiter,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mavlink.MAV_CMD_CONDITION_YAW: _yaw,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mavlink.MAV_CMD_MISSION_START: _mission_start,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
    mavlink.MAV_CMD_DO_SET_HOME: _set_home,
    mavlink.MAV_CMD_GET_HOME_POSITION: _get_home,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _capabilities,
    PLACE: _put,
}
