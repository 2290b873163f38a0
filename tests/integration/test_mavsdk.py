"""MAVSDK-Python, as its users have it from PyPI, flies our PX4-flavoured vehicle."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.offboard import Offboard, PositionNedYaw, VelocityBodyYawspeed, VelocityNedYaw
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import LandedState, Telemetry

from sim.vehicle.server import Options
from tests.integration.vehicles import HOST, vehicle

pytestmark = pytest.mark.integration
SPEED = 3.0
NAN = math.nan


@pytest.fixture
def system() -> Iterator[Any]:
    with (
        vehicle(Options(system=2, speed=SPEED)) as options,
        Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as sdk,
    ):
        sdk.add_any_connection(f"udpin://{HOST}:{options.port}")
        found = sdk.first_autopilot(30.0)
        assert found is not None, "connect"
        yield found


def until(condition: Callable[[], bool], what: str, seconds: float = 30.0) -> None:
    end, pause = time.monotonic() + seconds, threading.Event()
    while not condition():
        assert time.monotonic() < end, what
        pause.wait(0.05)


def healthy(telemetry: Telemetry) -> bool:
    return all(vars(telemetry.health()).values())


def away(telemetry: Telemetry, north: float, east: float, down: float) -> float:
    """Distance from a place [m]."""
    place = telemetry.position_velocity_ned().position
    return math.dist((place.north_m, place.east_m, place.down_m), (north, east, down))


def waypoint(latitude: float, longitude: float, height: float) -> MissionItem:
    none = MissionItem.CameraAction.NONE
    return MissionItem(
        latitude, longitude, height, 2.0, True, NAN, NAN, none, NAN, 1.0, 0.5, NAN, NAN,
        MissionItem.VehicleAction.NONE,
    )  # fmt: skip


def test_everything_that_issue_6_lists(system: Any) -> None:
    telemetry, action, param = Telemetry(system), Action(system), Param(system)
    offboard, mission = Offboard(system), Mission(system)
    assert system.get_system_id() == 2

    until(lambda: healthy(telemetry), "health")
    assert telemetry.gps_info().num_satellites >= 6
    assert telemetry.battery().remaining_percent > 50
    home = telemetry.home()
    assert home.latitude_deg == pytest.approx(47.397742, abs=1e-6)

    parameters = param.get_all_params()
    assert len(parameters.int_params) + len(parameters.float_params) > 10
    param.set_param_float("MIS_TAKEOFF_ALT", 3.0)
    assert param.get_param_float("MIS_TAKEOFF_ALT") == 3.0
    param.set_param_int("COM_OBL_RC_ACT", 4)
    assert param.get_param_int("COM_OBL_RC_ACT") == 4
    assert action.get_takeoff_altitude() == 3.0

    action.takeoff()  # the real PX4 accepts it while disarmed, stays down, and flies when it arms
    assert not telemetry.armed()
    action.arm()
    until(telemetry.armed, "arm")
    until(lambda: telemetry.position().relative_altitude_m > 2.6, "take-off")
    until(lambda: telemetry.landed_state() == LandedState.IN_AIR, "landed state")

    offboard.set_velocity_ned(VelocityNedYaw(1.0, 0.0, 0.0, 90.0))
    offboard.start()
    until(lambda: telemetry.flight_mode().name == "OFFBOARD", "offboard")
    until(lambda: abs(telemetry.velocity_ned().north_m_s - 1.0) < 0.1, "offboard velocity")
    until(lambda: abs(telemetry.attitude_euler().yaw_deg - 90.0) < 5.0, "offboard yaw")
    offboard.set_position_ned(PositionNedYaw(2.0, 1.0, -2.5, 0.0))
    until(lambda: away(telemetry, 2.0, 1.0, -2.5) < 0.3, "offboard position")
    offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 30.0))
    rate = telemetry.attitude_angular_velocity_body
    until(lambda: abs(rate().yaw_rad_s - math.radians(30)) < 0.1, "offboard yaw rate")
    offboard.stop()

    north = home.latitude_deg + 5e-5
    action.goto_location(north, home.longitude_deg, home.absolute_altitude_m + 4.0, 0.0)
    until(lambda: abs(telemetry.position().latitude_deg - north) < 3e-6, "goto")
    action.hold()
    until(lambda: telemetry.flight_mode().name == "HOLD", "hold")

    plan = [
        waypoint(home.latitude_deg + 2e-5, home.longitude_deg, 4.0),
        waypoint(home.latitude_deg + 6e-5, home.longitude_deg + 1e-5, 3.0),
    ]
    mission.upload_mission(MissionPlan(plan))
    back = mission.download_mission().mission_items
    assert [(i.latitude_deg, i.longitude_deg) for i in back] == [
        (pytest.approx(i.latitude_deg, abs=1e-7), pytest.approx(i.longitude_deg, abs=1e-7))
        for i in plan
    ]
    mission.start_mission()
    until(mission.is_mission_finished, "mission")
    assert mission.mission_progress().current == 2
    mission.clear_mission()

    action.return_to_launch()
    until(lambda: telemetry.flight_mode().name == "RETURN_TO_LAUNCH", "return")
    action.land()
    until(lambda: telemetry.landed_state() == LandedState.ON_GROUND, "land")
    until(lambda: not telemetry.armed(), "disarm after landing")
