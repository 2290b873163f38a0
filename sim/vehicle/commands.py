"""Commands: COMMAND_LONG and COMMAND_INT, each answered with a COMMAND_ACK, also the refusals.

Interface: :func:`run`.  UNSUPPORTED for what is unknown, DENIED for arguments that make no sense,
and the flavour's own refusal (PX4: TEMPORARILY_REJECTED, ArduPilot: FAILED) with a STATUSTEXT
where the state of the vehicle forbids it.  What moves the vehicle is in ``orders``; requests for
messages, intervals and home are here.

Source: https://mavlink.io/en/services/command.html
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from sim.vehicle import orders, telemetry
from sim.vehicle.command import DENIED, Command, Refusal, place_of, read, require
from sim.vehicle.dialect import Message, mavlink

if TYPE_CHECKING:
    from sim.vehicle.autopilot import Autopilot

FAILED = mavlink.MAV_RESULT_FAILED
ACCEPTED, UNSUPPORTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_UNSUPPORTED
PLACE = mavlink.MAV_CMD_USER_1  # lockstep only: be at x, y, z [m, NED], yaw [rad]; 7: seed


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
        orders.enter(pilot, message.custom_mode)
        result = ACCEPTED
    except Refusal as refusal:
        result = refusal.result
    return mavlink.MAVLink_command_ack_message(
        mavlink.MAVLINK_MSG_ID_SET_MODE, result, 0, 0, *sender
    )


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
    known = id_ in telemetry.BUILDERS or id_ == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT
    if pilot.flavour.px4 and (not known or id_ == mavlink.MAVLINK_MSG_ID_HEARTBEAT):
        raise Refusal(FAILED)
    if not known:
        raise Refusal(DENIED, f"No ap_message for mavlink id ({id_})")
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


def _set_current(pilot: Autopilot, command: Command) -> None:
    if not pilot.missions.set_current(command.whole(1)):
        raise Refusal(DENIED)


def _set_home(pilot: Autopilot, command: Command) -> None:
    if not pilot.estimator:
        require(pilot, "no position estimate yet")
    if command.params[0] == 1:
        pilot.home_ned = pilot.body.position
    else:
        pilot.home_ned = place_of(pilot, command.frame, command.x, command.y, command.z)
    _send(pilot, mavlink.MAVLINK_MSG_ID_HOME_POSITION)


def _get_home(pilot: Autopilot, command: Command) -> None:
    del command
    _send(pilot, mavlink.MAVLINK_MSG_ID_HOME_POSITION)


def _capabilities(pilot: Autopilot, command: Command) -> None:
    del command
    _send(pilot, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)


ACTIONS: dict[int, Callable[[Autopilot, Command], None]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: orders.arm_or_disarm,
    mavlink.MAV_CMD_NAV_TAKEOFF: orders.take_off,
    mavlink.MAV_CMD_NAV_LAND: orders.land,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: orders.go_home,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: orders.loiter,
    mavlink.MAV_CMD_DO_SET_MODE: orders.set_mode,
    mavlink.MAV_CMD_DO_REPOSITION: orders.reposition,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: orders.change_speed,
    mavlink.MAV_CMD_CONDITION_YAW: orders.turn,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mavlink.MAV_CMD_MISSION_START: orders.mission_start,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: orders.pause,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
    mavlink.MAV_CMD_DO_SET_HOME: _set_home,
    mavlink.MAV_CMD_GET_HOME_POSITION: _get_home,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _capabilities,
    PLACE: orders.put,
}
