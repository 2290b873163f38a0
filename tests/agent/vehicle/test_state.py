"""Telemetry is checked before it is kept."""

import math

import pytest

from agent.vehicle.dialects import mavlink
from agent.vehicle.state import READERS, Message, VehicleState

PREARM, AHRS = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_AHRS


def read(state: VehicleState, message: Message, now: float) -> VehicleState:
    return READERS[message.get_type()](state, message, now)


def position(ms: int, x: float = 1.0, vz: float = 0.0) -> Message:
    return mavlink.MAVLink_local_position_ned_message(ms, x, 2.0, -3.0, 0.0, 0.0, vz)


def attitude(roll: float = 0.1, yaw: float = 0.3) -> Message:
    return mavlink.MAVLink_attitude_message(0, roll, 0.2, yaw, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e7])
def test_numbers_that_are_none_leave_what_was_known_and_say_so(bad: float) -> None:
    state = read(read(VehicleState(), position(100), 1.0), attitude(), 1.0)
    for message, said in (
        (position(140, x=bad), f"LOCAL_POSITION_NED.x = {bad}"),
        (position(140, vz=bad), f"LOCAL_POSITION_NED.vz = {bad}"),
        (attitude(roll=bad), f"ATTITUDE.roll = {bad}"),
        (attitude(yaw=bad), f"ATTITUDE.yaw = {bad}"),
        (mavlink.MAVLink_home_position_message(0, 0, 0, bad, 0, 0, [1, 0, 0, 0], 0, 0, 0),
         f"HOME_POSITION.x = {bad}"),
    ):  # fmt: skip
        after = read(state, message, 2.0)
        assert after.unusable.startswith(said[:-3])
        assert (after.position, after.position_at) == (state.position, 1.0)
        assert (after.attitude, after.attitude_at) == (state.attitude, 1.0)
        assert after.home is None


def test_a_jump_of_the_estimate_is_told_from_flying() -> None:
    state = read(read(VehicleState(), position(1000), 1.0), position(1040, x=1.4), 1.04)
    assert state.jump == 0.0
    state = read(state, position(1080, x=6.4), 1.08)
    assert state.jump == pytest.approx(5.0) and state.jumped_at == 1.08
    assert read(state, position(1120, x=6.4), 1.12).jumped_at == 1.08
    far = read(state, position(2080, x=20.0), 2.08)  # 14 m in a second without telemetry
    assert far.jumped_at == 1.08


def test_an_autopilot_that_restarts_is_noticed() -> None:
    state = read(VehicleState(), position(60_000), 1.0)
    assert read(state, position(59_990), 1.1).restarts == 0  # an old datagram
    again = read(state, position(800, x=40.0), 3.0)
    assert again.restarts == 1 and again.jump == 0.0


@pytest.mark.parametrize(
    ("autopilot", "present", "health", "ok"),
    [
        (12, AHRS, AHRS, False),  # PX4 never sets the bit in `present`
        (12, AHRS, AHRS | PREARM, True),
        (3, AHRS, AHRS, True),  # ArduPilot without the bit does not tell
        (3, AHRS | PREARM, AHRS, False),
        (3, AHRS | PREARM, AHRS | PREARM, True),
    ],
)
def test_who_may_arm(autopilot: int, present: int, health: int, ok: bool) -> None:
    state = VehicleState(autopilot=autopilot)
    message = mavlink.MAVLink_sys_status_message(
        present, present, health, 0, 12_000, 100, 80, 0, 0, 0, 0, 0, 0
    )
    state = read(state, message, 1.0)
    assert state.prearm_ok is ok
    assert state.battery == 0.8 and state.estimator_ok


@pytest.mark.parametrize(("left", "share"), [(-1, None), (0, 0.0), (100, 1.0), (101, None)])
def test_the_battery_is_a_share(left: int, share: float | None) -> None:
    message = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, left, 0, 0, 0, 0, 0, 0)
    assert read(VehicleState(), message, 1.0).battery == share


def test_a_failsafe_is_told_by_the_heartbeat() -> None:
    for status, failsafe in ((3, False), (4, False), (5, True), (6, True)):
        message = mavlink.MAVLink_heartbeat_message(2, 12, 209, 0x30000, status, 3)
        assert read(VehicleState(), message, 1.0).failsafe is failsafe
