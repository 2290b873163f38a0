"""Messages in: which are for us, and who deals with them.

Interface: :func:`sort`.  Commands go to ``commands``, set points through ``setpoints``, missions to
``missions``; the small services (parameters, TIMESYNC, PING, data streams) are answered here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.vehicle import commands, orders, setpoints, telemetry
from sim.vehicle.codec import Attitude, LocalPosition, SetPointMessage
from sim.vehicle.dialect import Message, mavlink

if TYPE_CHECKING:
    from sim.vehicle.autopilot import Autopilot

_PARAMETER_MESSAGES = {"PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"}
_ITEM_MESSAGES = {"MISSION_ITEM", "MISSION_ITEM_INT"}
_MISSION_MESSAGES = _ITEM_MESSAGES | {
    "MISSION_COUNT",
    "MISSION_REQUEST_LIST",
    "MISSION_REQUEST",
    "MISSION_REQUEST_INT",
    "MISSION_CLEAR_ALL",
    "MISSION_SET_CURRENT",
}


def sort(pilot: Autopilot, message: Message) -> None:
    """Act on one message; the replies go out by ``pilot.send``."""
    if not isinstance(message, LocalPosition | Attitude) and _for_us(pilot, message):
        _dispatch(pilot, message)


def _for_us(pilot: Autopilot, message: Message) -> bool:
    return getattr(message, "target_system", 0) in {0, pilot.system} and getattr(
        message, "target_component", 0
    ) in {0, pilot.component}


def _dispatch(pilot: Autopilot, message: Message) -> None:
    if isinstance(message, SetPointMessage):
        body = pilot.body
        target = setpoints.from_local(message, pilot.flavour, body.position, body.attitude[2])
        if target is None and pilot.flavour.px4:
            pilot.say(setpoints.complaint(message), mavlink.MAV_SEVERITY_ERROR)
        pilot.take(target)
        return
    kind = message.get_type()
    if kind in {"COMMAND_LONG", "COMMAND_INT"}:
        pilot.send(commands.run(pilot, message))
    elif kind == "SET_POSITION_TARGET_GLOBAL_INT":
        pilot.take(setpoints.from_global(message, pilot.flavour, pilot.origin, pilot.home))
    elif kind in _PARAMETER_MESSAGES:
        pilot.send(*_parameters(pilot, kind, message))
    elif kind in _MISSION_MESSAGES:
        _mission(pilot, kind, message)
    elif kind == "SET_MODE":
        pilot.send(commands.set_mode_message(pilot, message))
    elif kind == "TIMESYNC" and message.tc1 == 0:
        pilot.send(mavlink.MAVLink_timesync_message(round(pilot.now * 1e9), message.ts1))
    elif kind == "PING" and message.target_system == 0:
        pilot.send(
            mavlink.MAVLink_ping_message(
                message.time_usec, message.seq, message.get_srcSystem(),
                message.get_srcComponent(),
            )
        )  # fmt: skip
    elif kind == "REQUEST_DATA_STREAM" and not pilot.flavour.px4:
        _data_stream(pilot, message)
    elif kind == "FILE_TRANSFER_PROTOCOL":
        pilot.send(_no_files(message))


def _parameters(pilot: Autopilot, kind: str, message: Message) -> list[Message]:
    if kind == "PARAM_REQUEST_LIST":
        return pilot.parameters.all()
    if kind == "PARAM_REQUEST_READ":
        answer = pilot.parameters.read(message.param_id, message.param_index)
    else:
        answer = pilot.parameters.write(message.param_id, message.param_value, message.param_type)
    return [] if answer is None else [answer]


def _mission(pilot: Autopilot, kind: str, message: Message) -> None:
    if kind in _ITEM_MESSAGES and message.current == 2 and not pilot.flavour.px4:
        verdict = orders.guided_item(pilot, message)
        sender = (message.get_srcSystem(), message.get_srcComponent())
        pilot.send(mavlink.MAVLink_mission_ack_message(*sender, verdict))
        return
    pilot.send(*pilot.missions.handle(message, pilot.now))


def _data_stream(pilot: Autopilot, message: Message) -> None:
    groups = telemetry.DATA_STREAMS
    wanted = (
        [id_ for ids in groups.values() for id_ in ids]
        if message.req_stream_id == mavlink.MAV_DATA_STREAM_ALL
        else groups.get(message.req_stream_id, ())
    )
    rate = message.req_message_rate
    for id_ in wanted:
        seconds = 1 / rate if message.start_stop and rate else None
        pilot.streams.every(id_, seconds, pilot.now)


def _no_files(message: Message) -> Message:
    """There are no files here: NAK with "unknown command"."""
    payload = bytearray(message.payload)
    session, opcode = payload[2], payload[3]
    sequence = (int.from_bytes(bytes(payload[0:2]), "little") + 1) & 0xFFFF
    answer = bytearray(251)
    answer[0:2] = sequence.to_bytes(2, "little")
    answer[2], answer[3], answer[4], answer[5], answer[12] = session, 129, 1, opcode, 7
    return mavlink.MAVLink_file_transfer_protocol_message(
        0, message.get_srcSystem(), message.get_srcComponent(), list(answer)
    )
