"""Parameters as both autopilots encode them; the mission protocol, and missions flown."""

import struct

import numpy as np
import pytest

from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import ARDUPILOT, PX4, Flavour, Mode
from sim.vehicle.parameters import Parameters
from tests.sim.vehicle.cockpit import ACCEPTED, ARM, Cockpit

WAYPOINT, TAKEOFF, LAND, SPEED = 16, 22, 21, 178
BYTEWISE, CAST = 1 << 17, 1 << 3


@pytest.fixture(params=[PX4, ARDUPILOT], ids=lambda flavour: flavour.name)
def flavour(request: pytest.FixtureRequest) -> Flavour:
    return request.param  # type: ignore[no-any-return]


def test_integers_travel_as_the_capabilities_say() -> None:
    px4, ardupilot = Parameters(PX4, 9), Parameters(ARDUPILOT, 9)
    theirs, ours = px4.read("MAV_SYS_ID", -1), ardupilot.read("SYSID_THISMAV", -1)
    assert theirs is not None
    assert ours is not None
    bits = theirs.param_value
    assert struct.unpack("<i", struct.pack("<f", bits)) == (9,)
    assert ours.param_value == 9.0
    assert PX4.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    assert ARDUPILOT.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST


def test_list_read_write(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour)
    listed = cockpit.tell(mavlink.MAVLink_param_request_list_message(1, 1))
    assert [m.param_index for m in listed] == list(range(listed[0].param_count))
    assert all(len(m.param_id) <= 16 for m in listed)
    name = b"MIS_TAKEOFF_ALT" if flavour.px4 else b"WPNAV_SPEED"
    (read,) = cockpit.tell(mavlink.MAVLink_param_request_read_message(1, 1, name, -1))
    (again,) = cockpit.tell(mavlink.MAVLink_param_request_read_message(1, 1, b"", read.param_index))
    assert again.param_id == read.param_id == name.decode()
    (wrote,) = cockpit.tell(mavlink.MAVLink_param_set_message(1, 1, name, 50.0, 9))
    assert wrote.param_value == 50.0
    for bad in (-1.0, 1e9, float("nan")):  # out of range: the old value is the answer
        (kept,) = cockpit.tell(mavlink.MAVLink_param_set_message(1, 1, name, bad, 9))
        assert kept.param_value == 50.0
    assert not cockpit.tell(mavlink.MAVLink_param_set_message(1, 1, b"NO_SUCH", 1.0, 9))
    assert not cockpit.tell(mavlink.MAVLink_param_request_read_message(1, 1, b"", 999))


def item(seq: int, command: int, north: float, z: float, cockpit: Cockpit, **p: float) -> Message:
    home = cockpit.pilot.home
    x = round((home.latitude + north / 111_190) * 1e7) if north else 0
    y = round(home.longitude * 1e7) if north else 0
    return mavlink.MAVLink_mission_item_int_message(
        1, 1, seq, 6, command, 0, 1, p.get("p1", 0), p.get("p2", 0), 0, float("nan"), x, y, z
    )


def upload(cockpit: Cockpit, items: list[Message]) -> int:
    """The MAV_MISSION_RESULT at the end of an upload."""
    (reply,) = cockpit.tell(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    while reply.get_type() == "MISSION_REQUEST_INT":
        reply, *_ = cockpit.tell(items[reply.seq])
    assert reply.get_type() == "MISSION_ACK"
    return int(reply.type)


def test_upload_download_clear(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour)
    items = [
        item(0, TAKEOFF, 0, 3.0, cockpit),
        item(1, WAYPOINT, 5, 3.0, cockpit),
        item(2, SPEED, 0, float("nan"), cockpit, p1=1, p2=2),
        item(3, LAND, 0, 0, cockpit),
    ]
    assert upload(cockpit, items) == mavlink.MAV_MISSION_ACCEPTED
    (count,) = cockpit.tell(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    assert count.count == 4
    for seq, sent in enumerate(items):
        (back,) = cockpit.tell(mavlink.MAVLink_mission_request_int_message(1, 1, seq, 0))
        assert (back.seq, back.command, back.x, back.y) == (seq, sent.command, sent.x, sent.y)
    (bad,) = cockpit.tell(mavlink.MAVLink_mission_request_int_message(1, 1, 4, 0))
    assert bad.type == mavlink.MAV_MISSION_ERROR
    (current,) = cockpit.tell(mavlink.MAVLink_mission_set_current_message(1, 1, 2))
    assert current.seq == 2
    (ack,) = cockpit.tell(mavlink.MAVLink_mission_clear_all_message(1, 1, 0))
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED
    assert not cockpit.pilot.missions.items


def test_refused_missions_leave_the_old_one(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour)
    assert upload(cockpit, [item(0, WAYPOINT, 5, 3.0, cockpit)]) == 0
    assert upload(cockpit, [item(0, 999, 5, 3.0, cockpit)]) == mavlink.MAV_MISSION_UNSUPPORTED
    nan = item(0, WAYPOINT, 5, float("nan"), cockpit)
    assert upload(cockpit, [nan]) == mavlink.MAV_MISSION_INVALID_PARAM7
    (fence,) = cockpit.tell(mavlink.MAVLink_mission_count_message(1, 1, 3, 1))
    assert fence.type == mavlink.MAV_MISSION_UNSUPPORTED
    (much,) = cockpit.tell(mavlink.MAVLink_mission_count_message(1, 1, 60_000, 0))
    assert much.type == mavlink.MAV_MISSION_NO_SPACE
    assert len(cockpit.pilot.missions.items) == 1


def test_an_upload_that_stalls_is_asked_for_again_then_cancelled(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour)
    cockpit.tell(mavlink.MAVLink_mission_count_message(1, 1, 2, 0))
    said = [m for m in cockpit.wait(10.0) if not isinstance(m, tuple)]
    asked = [m for m in said if m.get_type() == "MISSION_REQUEST_INT"]
    acks = [m for m in said if m.get_type() == "MISSION_ACK"]
    assert [m.seq for m in asked] == [0] * (19 if flavour.px4 else 7)
    cancelled = [] if flavour.px4 else [mavlink.MAV_MISSION_OPERATION_CANCELLED]
    assert [m.type for m in acks] == cancelled
    text = "Operation timeout" if flavour.px4 else "Mission upload timeout"
    assert [m.text for m in said if m.get_type() == "STATUSTEXT"] == [text]


def test_the_last_item_again_after_the_ack(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour)
    only = item(0, WAYPOINT, 5, 3.0, cockpit)
    assert upload(cockpit, [only]) == 0
    for _ in range(2):
        (ack,) = cockpit.tell(only)
        assert ack.type == (0 if flavour.px4 else mavlink.MAV_MISSION_ERROR)


def test_clearing_during_an_upload(flavour: Flavour) -> None:
    """PX4 is busy, and the upload goes on; ArduPilot ends it and has no mission."""
    cockpit = Cockpit(flavour)
    only = item(0, WAYPOINT, 5, 3.0, cockpit)
    assert upload(cockpit, [only]) == 0
    cockpit.tell(mavlink.MAVLink_mission_count_message(1, 1, 2, 0))
    (answer,) = cockpit.tell(mavlink.MAVLink_mission_clear_all_message(1, 1, 0))
    assert answer.get_type() == ("STATUSTEXT" if flavour.px4 else "MISSION_ACK")
    assert len(cockpit.pilot.missions.items) == (1 if flavour.px4 else 0)
    (answer,) = cockpit.tell(only)
    assert answer.get_type() == ("MISSION_REQUEST_INT" if flavour.px4 else "MISSION_ACK")


def test_a_count_in_the_middle_of_an_upload_is_refused_by_px4() -> None:
    cockpit = Cockpit(PX4)
    cockpit.tell(mavlink.MAVLink_mission_count_message(1, 1, 2, 0))
    cockpit.tell(item(0, WAYPOINT, 5, 3.0, cockpit))
    text, ack = cockpit.tell(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    assert text.text == "WPM: IGN MISSION_COUNT: Busy"
    assert ack.type == mavlink.MAV_MISSION_ERROR


def test_a_mission_is_flown_item_by_item(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour)
    cockpit.wait(6.0)
    first = [] if flavour.px4 else [item(0, WAYPOINT, 0, 0, cockpit)]  # ArduPilot's home
    rest = [(TAKEOFF, 0.0, 3.0), (WAYPOINT, 6.0, 3.0), (WAYPOINT, 3.0, 4.0), (LAND, 3.0, 0.0)]
    items = first + [
        item(seq + len(first), command, north, z, cockpit)
        for seq, (command, north, z) in enumerate(rest)
    ]
    assert upload(cockpit, items) == 0
    if flavour.px4:
        assert cockpit.command(ARM, 1) == ACCEPTED
        assert cockpit.command(300) == ACCEPTED
    else:
        assert cockpit.enter(Mode.GUIDED) == ACCEPTED
        assert cockpit.command(ARM, 1) == ACCEPTED
        assert cockpit.enter(Mode.MISSION) == ACCEPTED
    said, farthest = [], 0.0
    for _ in range(80):
        said += cockpit.wait(0.5)
        farthest = max(farthest, float(cockpit.body.position[0]))
    reached = [
        m.seq for m in said if not isinstance(m, tuple) and m.get_type() == "MISSION_ITEM_REACHED"
    ]
    assert reached == [len(first) + k for k in range(3)]
    assert farthest == pytest.approx(6.0, abs=0.6)
    assert cockpit.body.on_ground
    assert not cockpit.pilot.armed
    assert cockpit.body.position[0] == pytest.approx(3.0, abs=0.6)


def test_mission_start_arms_px4_and_not_ardupilot(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour)
    cockpit.wait(6.0)
    assert upload(cockpit, [item(0, TAKEOFF, 0, 3.0, cockpit)]) == 0
    assert cockpit.command(300) == ACCEPTED
    assert cockpit.pilot.mode is Mode.MISSION
    assert cockpit.pilot.armed is flavour.px4


def test_a_value_beyond_what_is_known_is_taken() -> None:
    cockpit = Cockpit(PX4)
    bits = struct.unpack("<f", struct.pack("<i", 6))[0]
    (back,) = cockpit.tell(mavlink.MAVLink_param_set_message(1, 1, b"COM_OBL_RC_ACT", bits, 6))
    assert struct.unpack("<i", struct.pack("<f", back.param_value))[0] == 6


def test_pause_and_go_on() -> None:
    cockpit = Cockpit(PX4)
    cockpit.wait(3.0)
    assert upload(cockpit, [item(0, WAYPOINT, 20, 3.0, cockpit)]) == 0
    cockpit.command(ARM, 1)
    cockpit.command(300)
    cockpit.wait(6.0)
    assert cockpit.command(193, 0) == ACCEPTED
    cockpit.wait(4.0)
    assert cockpit.pilot.mode.value == "hold"
    assert np.linalg.norm(cockpit.body.velocity) < 0.1
    assert cockpit.command(193, 1) == ACCEPTED
    assert cockpit.pilot.mode.value == "mission"


def test_dronekits_simple_goto_is_ardupilots() -> None:
    cockpit = Cockpit(ARDUPILOT)
    cockpit.fly()
    home = cockpit.pilot.home
    goto = mavlink.MAVLink_mission_item_message(
        1, 1, 0, 3, WAYPOINT, 2, 0, 0, 0, 0, 0, home.latitude + 4e-5, home.longitude, 3.0
    )
    (ack,) = cockpit.tell(goto)
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED
    cockpit.wait(8.0)
    assert cockpit.body.position == pytest.approx((4.45, 0, -3.05), abs=0.6)
