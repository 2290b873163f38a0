"""What the autopilot says and does, row by row of the message table, without a socket."""

import math
from collections import Counter

import numpy as np
import pytest

from sim.vehicle.codec import LocalPosition, SetPointMessage
from sim.vehicle.dialect import mavlink
from sim.vehicle.flavours import ARDUPILOT, PX4, Flavour, Mode
from sim.vehicle.frames import Doubles
from tests.sim.vehicle.cockpit import (
    ACCEPTED,
    ARM,
    DENIED,
    FAILED,
    LAND,
    POSITION_YAW,
    RTL,
    SET_MODE,
    TAKEOFF,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    VELOCITY_RATE,
    VELOCITY_YAW,
    Cockpit,
    kinds,
    result_of,
)

NAN = math.nan


@pytest.fixture(params=[PX4, ARDUPILOT], ids=lambda flavour: flavour.name)
def flavour(request: pytest.FixtureRequest) -> Flavour:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture
def cockpit(flavour: Flavour) -> Cockpit:
    return Cockpit(flavour)


@pytest.fixture
def flying(cockpit: Cockpit) -> Cockpit:
    cockpit.fly()
    return cockpit


def test_px4_streams_by_itself_at_the_stated_rates() -> None:
    cockpit = Cockpit(PX4)
    cockpit.wait(3.0)
    said = cockpit.wait(10.0)
    rate = Counter("LP" if isinstance(m, LocalPosition) else type(m).__name__ for m in said)
    assert rate["MAVLink_heartbeat_message"] == 10
    assert rate["LP"] == pytest.approx(250, abs=1)
    assert rate["Attitude"] == pytest.approx(250, abs=1)
    assert rate["MAVLink_sys_status_message"] == 20
    assert rate["MAVLink_global_position_int_message"] == 100
    assert {"EXTENDED_SYS_STATE", "HOME_POSITION", "BATTERY_STATUS", "VFR_HUD", "GPS_RAW_INT",
            "SYSTEM_TIME"} <= kinds(said)  # fmt: skip


def test_ardupilot_streams_only_when_asked() -> None:
    cockpit = Cockpit(ARDUPILOT)
    assert kinds(cockpit.wait(8.0)) == {"HEARTBEAT"}
    cockpit.tell(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    assert {"LocalPosition", "Attitude", "SYS_STATUS", "GLOBAL_POSITION_INT"} <= kinds(
        cockpit.wait(2.0)
    )
    cockpit.tell(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 4, 0))
    cockpit.wait(0.1)
    assert kinds(cockpit.wait(5.0)) == {"HEARTBEAT"}


def test_message_intervals_and_requests(cockpit: Cockpit, flavour: Flavour) -> None:
    cockpit.wait(6.0)
    assert cockpit.command(511, 32, 100_000) == ACCEPTED
    assert sum(isinstance(m, LocalPosition) for m in cockpit.wait(5.0)) == pytest.approx(50, abs=1)
    assert cockpit.command(511, 32, -1) == ACCEPTED
    assert not any(isinstance(m, LocalPosition) for m in cockpit.wait(1.0))
    assert cockpit.command(511, 9999, 1000) == (FAILED if flavour.px4 else DENIED)
    assert cockpit.command(511, 0, 1000) == (FAILED if flavour.px4 else ACCEPTED)
    assert cockpit.command(511, 30, 5000) == ACCEPTED
    asked = mavlink.MAVLink_command_long_message(1, 1, 510, 0, 30, 0, 0, 0, 0, 0, 0)
    assert [m.interval_us for m in cockpit.tell(asked) if m.get_type() == "MESSAGE_INTERVAL"] == [
        5000
    ]
    assert cockpit.command(511, NAN, 1000) == DENIED
    assert cockpit.command(511, 32, NAN) == DENIED
    for id_, kind in ((148, "AUTOPILOT_VERSION"), (242, "HOME_POSITION"), (30, "Attitude")):
        message = mavlink.MAVLink_command_long_message(1, 1, 512, 0, id_, 0, 0, 0, 0, 0, 0)
        replies = cockpit.tell(message)
        assert result_of(replies) == ACCEPTED
        assert kind in kinds(replies)
    assert cockpit.command(512, 9999) == UNSUPPORTED


def test_heartbeat_says_who_and_how(cockpit: Cockpit, flavour: Flavour) -> None:
    def beat() -> mavlink.MAVLink_heartbeat_message:
        return next(
            m for m in cockpit.wait(1.02)
            if not isinstance(m, tuple) and m.get_type() == "HEARTBEAT"
        )  # fmt: skip

    assert (beat().type, beat().autopilot) == (2, 12 if flavour.px4 else 3)
    cockpit.fly()
    cockpit.stream(1.1, POSITION_YAW, p=(0, 0, -2))
    cockpit.setpoint(POSITION_YAW, p=(0, 0, -2))
    armed = cockpit.pilot.message(0)
    assert armed is not None
    assert armed.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert armed.custom_mode == (0x60000 if flavour.px4 else 4)


def test_nothing_flies_before_the_estimator_is_ready(cockpit: Cockpit, flavour: Flavour) -> None:
    refused = TEMPORARILY_REJECTED if flavour.px4 else FAILED
    cockpit.command(511, 32, 50_000)
    assert cockpit.command(ARM, 1) == refused
    assert not any(isinstance(m, LocalPosition) for m in cockpit.wait(1.0))
    cockpit.wait(6.0)
    assert any(isinstance(m, LocalPosition) for m in cockpit.wait(1.0))
    assert cockpit.command(ARM, 1) == ACCEPTED


def test_takeoff_while_disarmed(cockpit: Cockpit, flavour: Flavour) -> None:
    """PX4 takes it and waits for arming, as QGroundControl does it; ArduPilot fails silently."""
    cockpit.wait(6.0)
    message = mavlink.MAVLink_command_long_message(1, 1, TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 491.0)
    replies = cockpit.tell(message)
    assert result_of(replies) == (ACCEPTED if flavour.px4 else FAILED)
    assert kinds(replies) == {"COMMAND_ACK"}
    assert not cockpit.pilot.armed
    if flavour.px4:
        assert cockpit.pilot.mode is Mode.TAKEOFF
        assert cockpit.command(ARM, 1) == ACCEPTED
        cockpit.wait(6.0)
        assert -cockpit.body.position[2] == pytest.approx(3.05, abs=0.3)


def test_modes_while_disarmed(cockpit: Cockpit, flavour: Flavour) -> None:
    cockpit.wait(6.0)
    numbers = (
        [(4, 2), (4, 4), (6, 0), (4, 5), (4, 6), (3, 0), (2, 0), (1, 0), (7, 0), (4, 9)]
        if flavour.px4
        else [(number, 0) for number in (3, 4, 5, 6, 9, 17, 2, 21)]
    )
    for main, sub in numbers:
        assert cockpit.command(SET_MODE, 1, main, sub) == ACCEPTED
        assert cockpit.pilot.custom_mode == (main << 16 | sub << 24 if flavour.px4 else main)
        assert not cockpit.pilot.armed


def test_mission_start_while_disarmed(cockpit: Cockpit, flavour: Flavour) -> None:
    cockpit.wait(6.0)
    assert cockpit.command(300) == (DENIED if flavour.px4 else ACCEPTED)
    assert not cockpit.pilot.armed
    assert (cockpit.pilot.mode is Mode.MISSION) is not flavour.px4


def test_arming_by_force_asks_for_nothing(cockpit: Cockpit, flavour: Flavour) -> None:
    assert cockpit.command(ARM, 1, 5) == flavour.refusal
    assert cockpit.command(ARM, 1, 21196) == ACCEPTED
    assert cockpit.pilot.armed


def test_the_ready_bit_and_the_uid() -> None:
    for flavour in (PX4, ARDUPILOT):
        cockpit = Cockpit(flavour, system=7)
        cockpit.wait(6.0)
        status, version = cockpit.pilot.message(1), cockpit.pilot.message(148)
        assert status is not None
        assert version is not None
        bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        assert status.onboard_control_sensors_health & bit
        assert bool(status.onboard_control_sensors_present & bit) is not flavour.px4
        assert version.uid == 7


def test_the_yaw_of_a_body_frame(flying: Cockpit, flavour: Flavour) -> None:
    """PX4: absolute.  ArduPilot: from the heading at every message, so the nose goes on."""
    flying.stream(4.0, VELOCITY_YAW, yaw=1.0)
    flying.stream(4.0, VELOCITY_YAW, frame=8, yaw=0.5)
    turned = flying.body.attitude[2] % (2 * math.pi)
    assert (turned == pytest.approx(0.5, abs=0.05)) is flavour.px4


def test_px4_says_what_it_refuses() -> None:
    cockpit = Cockpit(PX4)
    cockpit.fly()
    for frame, mask, words in (
        (9, VELOCITY_YAW, "coordinate frame 9 unsupported"),
        (1, 4095, "invalid"),
        (8, POSITION_YAW, "invalid"),
        (1, 0x0C3F | 1 << 9, "force not supported"),
    ):
        fields = (0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, mask, 1, 1, frame)
        said = cockpit.tell(SetPointMessage._make(fields))
        text = "".join(m.text for m in said)
        assert text == f"SET_POSITION_TARGET_LOCAL_NED {words}"


def test_x_and_y_count_only_together(flying: Cockpit) -> None:
    flying.stream(3.0, VELOCITY_YAW | 1 << 4, v=(1, 1, 0))
    assert abs(flying.body.position[0]) < 0.1


def test_px4_at_its_own_default_sinks_when_set_points_stop() -> None:
    cockpit = Cockpit(PX4)
    cockpit.fly(6.0)
    assert cockpit.pilot.parameters.set("COM_OBL_RC_ACT", 0)
    cockpit.stream(2.0, VELOCITY_YAW, v=(0.7, 0, 0))
    cockpit.wait(2.5)
    beat = cockpit.pilot.message(0)
    assert beat is not None
    assert (beat.custom_mode, beat.system_status) == (3 << 16, mavlink.MAV_STATE_CRITICAL)
    assert cockpit.body.velocity[2] == pytest.approx(0.7, abs=0.1)


def test_takeoff_altitude_counts_from_where_the_flavour_says() -> None:
    px4, ardupilot = Cockpit(PX4), Cockpit(ARDUPILOT)
    px4.fly(3.0)  # 491 m above the sea
    ardupilot.fly(3.0)  # 3 m
    for cockpit in (px4, ardupilot):
        assert -cockpit.body.position[2] == pytest.approx(3.05, abs=0.3)
    cockpit = Cockpit(PX4)
    cockpit.wait(3.0)
    cockpit.command(ARM, 1)
    assert cockpit.command(TAKEOFF, NAN, NAN, NAN, NAN, NAN, NAN, NAN) == ACCEPTED
    cockpit.wait(6.0)  # MIS_TAKEOFF_ALT, 2.5 m
    assert -cockpit.body.position[2] == pytest.approx(2.55, abs=0.3)
    assert cockpit.pilot.mode is Mode.HOLD


def test_px4_arms_in_offboard_only_with_set_points() -> None:
    cockpit = Cockpit(PX4)
    cockpit.wait(3.0)
    assert cockpit.enter(Mode.GUIDED) == ACCEPTED
    assert cockpit.command(ARM, 1) == TEMPORARILY_REJECTED
    cockpit.setpoint(POSITION_YAW, p=(0, 0, -2))
    assert cockpit.command(ARM, 1) == ACCEPTED
    cockpit.stream(6.0, POSITION_YAW, p=(0, 0, -2))  # and takes off by a set point
    assert cockpit.body.position[2] == pytest.approx(-2.0, abs=0.2)


def test_ardupilot_needs_guided_and_takeoff() -> None:
    cockpit = Cockpit(ARDUPILOT)
    cockpit.wait(6.0)
    assert cockpit.command(ARM, 1) == ACCEPTED
    assert cockpit.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 2) == FAILED
    assert cockpit.enter(Mode.GUIDED) == ACCEPTED
    cockpit.stream(2.0, VELOCITY_YAW, v=(0, 0, -1))
    assert cockpit.body.on_ground
    assert cockpit.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 2) == ACCEPTED
    cockpit.wait(1.0)
    cockpit.setpoint(VELOCITY_YAW, v=(0, 0, 0))  # streaming set points aborts the take-off
    cockpit.wait(4.0)
    assert -cockpit.body.position[2] < 1.7


def test_set_points_in_every_frame_and_mask(flying: Cockpit) -> None:
    flying.stream(3.0, VELOCITY_YAW, v=(1, 0, 0), yaw=math.pi / 2)
    assert flying.body.velocity == pytest.approx((1, 0, 0), abs=0.05)
    assert flying.body.attitude[2] == pytest.approx(math.pi / 2, abs=0.05)
    flying.stream(3.0, VELOCITY_RATE, v=(1, 0, 0), frame=8)  # along the nose: east
    assert flying.body.velocity == pytest.approx((0, 1, 0), abs=0.05)
    before = flying.body.attitude[2]
    flying.stream(2.0, VELOCITY_RATE, rate=0.5)
    turned = flying.body.attitude[2] - before
    assert turned == pytest.approx(1.0, abs=0.2)
    flying.stream(8.0, POSITION_YAW, p=(1, 2, -3), yaw=0.0)
    assert flying.body.position == pytest.approx((1, 2, -3), abs=0.15)


def test_offsets_from_here_are_ardupilots_alone(flavour: Flavour, flying: Cockpit) -> None:
    here = flying.body.position
    flying.setpoint(POSITION_YAW, p=(2, 0, 0), frame=9, yaw=0.0)
    if flavour.px4:
        flying.stream(5.0, POSITION_YAW, p=(2, 0, 0), frame=9)
    else:
        flying.wait(5.0)
    moved = flying.body.position[0] - here[0]
    assert moved == pytest.approx(0.0 if flavour.px4 else 2.0, abs=0.15)


def test_nan_does_no_harm(flying: Cockpit, flavour: Flavour) -> None:
    yaw = flying.body.attitude[2]
    flying.stream(1.0, VELOCITY_YAW, p=(NAN, NAN, NAN), v=(0.5, 0, 0), yaw=NAN)
    assert flying.body.velocity[0] > 0.2
    assert flying.body.attitude[2] == pytest.approx(yaw, abs=0.05)
    flying.stream(4.0, VELOCITY_YAW, v=(NAN, NAN, NAN), yaw=NAN)
    flying.stream(1.0, POSITION_YAW, p=(math.inf, 0, -2))
    assert np.isfinite(flying.body.state).all()
    assert np.linalg.norm(flying.body.velocity) < (0.7 if flavour.px4 else 0.6)


@pytest.mark.parametrize("action", [3, 4, 5])
def test_px4_leaves_offboard_when_set_points_stop(action: int) -> None:
    cockpit = Cockpit(PX4)
    cockpit.fly()
    assert cockpit.pilot.parameters.set("COM_OBL_RC_ACT", action)
    cockpit.stream(2.0, VELOCITY_YAW, v=(1, 0, 0))
    cockpit.wait(0.8)
    assert cockpit.pilot.mode is Mode.GUIDED
    cockpit.wait(0.5)
    assert cockpit.pilot.mode is {3: Mode.RETURN, 4: Mode.LAND, 5: Mode.HOLD}[action]
    cockpit.wait(3.0)
    assert action != 5 or np.linalg.norm(cockpit.body.velocity) < 0.05


def test_ardupilot_stands_still_in_guided_after_three_seconds() -> None:
    cockpit = Cockpit(ARDUPILOT)
    cockpit.fly()
    cockpit.stream(2.0, VELOCITY_YAW, v=(1, 0, 0))
    cockpit.wait(2.7)
    assert cockpit.body.velocity[0] > 0.9
    cockpit.wait(3.0)
    assert np.linalg.norm(cockpit.body.velocity) < 0.05
    assert cockpit.pilot.mode is Mode.GUIDED


def test_landing_disarms(flying: Cockpit) -> None:
    assert flying.command(ARM, 0) in {TEMPORARILY_REJECTED, FAILED}  # not in the air
    assert flying.command(LAND) == ACCEPTED
    flying.wait(1.0)
    assert flying.pilot.landed_state == mavlink.MAV_LANDED_STATE_LANDING
    flying.wait(12.0)
    assert flying.pilot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    assert not flying.pilot.armed
    assert flying.body.impact < 1.2


def test_an_armed_vehicle_that_does_not_take_off_disarms(cockpit: Cockpit) -> None:
    cockpit.wait(6.0)
    assert cockpit.command(ARM, 1) == ACCEPTED
    cockpit.wait(9.0)
    assert cockpit.pilot.armed
    cockpit.wait(1.5)
    assert not cockpit.pilot.armed


def test_return_goes_home_and_lands(flying: Cockpit) -> None:
    for _ in range(40):
        flying.setpoint(POSITION_YAW, p=(6, -3, -2))
        flying.wait(0.2)
    assert flying.command(RTL) == ACCEPTED
    highest = 0.0
    while np.hypot(*flying.body.position[:2]) > 3.0:
        flying.wait(0.2)
        highest = max(highest, -float(flying.body.position[2]))
    assert highest > 4.4  # climbed first
    flying.wait(35.0)
    assert not flying.pilot.armed
    assert np.hypot(*flying.body.position[:2]) < 0.6


def test_killing_in_the_air_needs_the_magic_number_and_falls(flying: Cockpit) -> None:
    assert flying.command(ARM, 0, 21196) == ACCEPTED
    flying.wait(2.0)
    assert flying.body.on_ground


def test_unknown_commands_and_modes(cockpit: Cockpit) -> None:
    cockpit.wait(6.0)
    assert cockpit.command(12345) == UNSUPPORTED
    assert cockpit.command(31010, 1, 2, 3, 0) == UNSUPPORTED  # placing is for lockstep
    before = cockpit.pilot.custom_mode
    known = ACCEPTED if cockpit.pilot.flavour.px4 else FAILED
    assert cockpit.command(SET_MODE, 1, 77, 77) == known
    assert cockpit.pilot.custom_mode == before
    assert cockpit.command(SET_MODE, 0, 4) == DENIED
    assert cockpit.command(ARM, 7) == DENIED
    assert cockpit.command(ARM, NAN) == DENIED


def test_what_is_for_others_is_ignored(cockpit: Cockpit) -> None:
    cockpit.wait(6.0)
    assert cockpit.command(ARM, 1, target=9) is None
    assert not cockpit.pilot.armed
    cockpit.fly()
    cockpit.stream(1.0, VELOCITY_YAW, v=(3, 0, 0), target=9)
    assert abs(cockpit.body.velocity[0]) < 0.05


def test_reposition_change_speed_and_yaw(flying: Cockpit, flavour: Flavour) -> None:
    home = flying.pilot.home
    place = (round((home.latitude + 4e-5) * 1e7), round(home.longitude * 1e7))

    def reposition(frame: int, z: float, flag: float = 1.0) -> int | None:
        message = mavlink.MAVLink_command_int_message(
            1, 1, frame, 192, 0, 0, -1, flag, 0, NAN, *place, z
        )
        return result_of(flying.tell(message))

    assert flying.command(178, 1, 1.0) == ACCEPTED
    assert flying.command(178, 1, 99.0) == DENIED
    assert reposition(1, 3.0) == 9  # unsupported frame
    assert reposition(6, 3.0) == ACCEPTED  # 3 m above home
    fastest = 0.0
    for _ in range(60):
        flying.wait(0.2)
        fastest = max(fastest, float(np.hypot(*flying.body.velocity[:2])))
    assert flying.body.position == pytest.approx((4.45, 0.0, -3.05), abs=0.15)
    assert not flavour.px4 or fastest < 1.1
    assert reposition(5, home.altitude + 2.0) == ACCEPTED  # above the sea
    flying.wait(6.0)
    assert flying.body.position[2] == pytest.approx(-2.05, abs=0.15)
    assert flying.command(115, 90, 30, 1, 0) == ACCEPTED
    flying.wait(4.0)
    assert flying.body.attitude[2] == pytest.approx(math.pi / 2, abs=0.05)


def test_the_fence_and_the_speed_limit_hold(flavour: Flavour, flying: Cockpit) -> None:
    names = ("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST", "MPC_XY_VEL_MAX", 1) if flavour.px4 else (
        "FENCE_RADIUS", "FENCE_ALT_MAX", "WPNAV_SPEED", 100)  # fmt: skip
    for name, value in zip(names[:3], (5.0, 4.0, 2.0 * float(names[3])), strict=True):
        assert flying.pilot.parameters.set(str(name), value)
    fastest = 0.0
    for _ in range(80):
        flying.setpoint(VELOCITY_YAW, v=(8, 6, -3))
        flying.wait(0.1)
        fastest = max(fastest, float(np.hypot(*flying.body.velocity[:2])))
    assert fastest < 2.15
    assert -flying.body.position[2] < 4.2
    away = float(np.hypot(*flying.body.position[:2]))
    beat = flying.pilot.message(0)
    assert beat is not None
    if flavour.px4:  # it flies until the fence is broken, then holds
        assert 5.0 < away < 6.5
        assert flying.pilot.mode is Mode.HOLD
        assert beat.system_status == mavlink.MAV_STATE_CRITICAL
    else:  # it slows down and stops a margin of 2 m inside
        assert away == pytest.approx(3.0, abs=0.2)
        assert flying.pilot.mode is Mode.GUIDED


def test_the_fence_is_around_the_place_of_arming(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour)
    cockpit.body.place(30.0, 0.0, cockpit.body.state[2], 0.0, flying=False)
    cockpit.wait(6.0)
    name = "GF_MAX_HOR_DIST" if flavour.px4 else "FENCE_RADIUS"
    if not flavour.px4:  # it compares with the home that it had
        assert cockpit.pilot.parameters.set(name, 10.0)
        assert cockpit.command(ARM, 1) == FAILED
        assert cockpit.pilot.parameters.set(name, 0.0)
    cockpit.fly()
    assert cockpit.pilot.parameters.set(name, 10.0)
    cockpit.stream(4.0, VELOCITY_YAW, v=(1, 0, 0))
    assert cockpit.body.position[0] > 32.0
    assert cockpit.pilot.mode is Mode.GUIDED


def test_an_empty_battery_lands_and_keeps_from_arming(flying: Cockpit) -> None:
    flying.pilot.parameters.set("SIM_BAT_MIN_PCT", 0)
    flying.pilot.parameters.set("SIM_BAT_DRAIN", 5.0)
    flying.stream(8.0, POSITION_YAW, p=(0, 0, -2))
    assert flying.pilot.mode in {Mode.LAND, Mode.HOLD}
    flying.wait(10.0)
    assert not flying.pilot.armed
    assert flying.command(ARM, 1) in {TEMPORARILY_REJECTED, FAILED}


def test_a_crash_disarms(flying: Cockpit) -> None:
    flying.body.impact = 5.0
    flying.wait(0.1)
    assert not flying.pilot.armed


def test_what_bars_the_way_down_is_landed_on(flying: Cockpit) -> None:
    """The edge of a table: the sphere rests on it, there is no floor under the legs."""

    class Edge:
        def reach(self, start: Doubles, move: Doubles, radius: float) -> float:
            gap = -0.75 - radius - start[2]
            return max(gap, 0.0) / move[2] if move[2] > max(gap, 0.0) else math.inf

        def floor(self, place: Doubles) -> float:
            return 0.0

    flying.body.world = Edge()
    assert flying.command(LAND) == ACCEPTED
    flying.wait(8.0)
    assert not flying.pilot.armed
    assert flying.pilot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    assert flying.body.position[2] == pytest.approx(-1.0, abs=0.01)


def test_timesync_ping_and_the_older_set_mode(cockpit: Cockpit, flavour: Flavour) -> None:
    cockpit.wait(6.0)
    (answer,) = cockpit.tell(mavlink.MAVLink_timesync_message(0, 123))
    assert (answer.tc1, answer.ts1) == (6_000_000_000, 123)
    assert not cockpit.tell(mavlink.MAVLink_timesync_message(5, 123))
    (pong,) = cockpit.tell(mavlink.MAVLink_ping_message(7, 3, 0, 0))
    assert (pong.seq, pong.target_system) == (3, 255)
    (ack,) = cockpit.tell(mavlink.MAVLink_set_mode_message(1, 1, flavour.custom_mode(Mode.GUIDED)))
    assert (ack.command, ack.result) == (11, ACCEPTED)


def test_lockstep_places_the_vehicle_anywhere(flavour: Flavour) -> None:
    cockpit = Cockpit(flavour, lockstep=True)
    assert cockpit.command(31010, 1, 2, -3, 0.5) == ACCEPTED
    cockpit.pilot.advance(0.4)
    assert cockpit.body.position == pytest.approx((1, 2, -3), abs=0.01)
    assert cockpit.command(31010, NAN, 2, -3, 0.5) == DENIED
