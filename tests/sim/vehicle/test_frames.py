"""Frames and rotations against cases worked out by hand."""

import math

import numpy as np
import pytest

from sim.vehicle.control import attitude_from_thrust
from sim.vehicle.frames import (
    Geodetic,
    enu_from_ned,
    euler_from_quaternion,
    geodetic_from_ned,
    ned_from_geodetic,
    ned_from_heading,
    quaternion_from_euler,
    rotate,
    turn,
    wrap,
)

ROOT_HALF = math.sqrt(0.5)


def rotated(q: np.ndarray, v: tuple[float, float, float]) -> list[float]:
    out = np.empty(3)
    rotate(q, np.array(v), out)
    return [float(value) for value in out]


@pytest.mark.parametrize(
    ("euler", "quaternion"),
    [
        ((0, 0, 0), (1, 0, 0, 0)),
        ((0, 0, math.pi / 2), (ROOT_HALF, 0, 0, ROOT_HALF)),
        ((0, math.pi / 2, 0), (ROOT_HALF, 0, ROOT_HALF, 0)),
        ((math.pi / 2, 0, 0), (ROOT_HALF, ROOT_HALF, 0, 0)),
        ((0, 0, math.pi), (0, 0, 0, 1)),
        # roll then yaw by 90 degrees each: (1 + i)(1 + k) reordered as (1 + k)(1 + i) / 2
        ((math.pi / 2, 0, math.pi / 2), (0.5, 0.5, 0.5, 0.5)),
    ],
)
def test_known_rotations(euler: tuple[float, ...], quaternion: tuple[float, ...]) -> None:
    assert quaternion_from_euler(*map(float, euler)) == pytest.approx(quaternion, abs=1e-12)


@pytest.mark.parametrize(
    ("euler", "body", "world"),
    [
        ((0, 0, math.pi / 2), (1, 0, 0), (0, 1, 0)),  # nose east: forward is east
        ((0, 0, math.pi / 2), (0, 1, 0), (-1, 0, 0)),  # ... and right is south
        ((0, math.pi / 2, 0), (1, 0, 0), (0, 0, -1)),  # nose up: forward is up
        ((math.pi / 2, 0, 0), (0, 1, 0), (0, 0, 1)),  # right wing down: right is down
    ],
)
def test_where_body_axes_point(
    euler: tuple[float, ...], body: tuple[float, float, float], world: tuple[float, ...]
) -> None:
    assert rotated(quaternion_from_euler(*map(float, euler)), body) == pytest.approx(
        world, abs=1e-12
    )


def test_euler_angles_survive_the_quaternion() -> None:
    for roll, pitch, yaw in np.random.default_rng(1).uniform(-1.5, 1.5, (100, 3)):
        back = euler_from_quaternion(quaternion_from_euler(roll, pitch, yaw))
        assert back == pytest.approx((roll, pitch, yaw), abs=1e-12)


def test_turning_at_a_constant_rate_is_exact() -> None:
    q = quaternion_from_euler(0.0, 0.0, 0.0)
    for _ in range(250):
        turn(q, np.array([0.0, 0.0, math.pi / 2]), 1 / 250)
    assert euler_from_quaternion(q)[2] == pytest.approx(math.pi / 2, abs=1e-12)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-14)


def test_ned_and_enu() -> None:
    assert enu_from_ned((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert enu_from_ned(enu_from_ned((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)


def test_ahead_of_an_eastward_nose_is_east() -> None:
    assert ned_from_heading(math.pi / 2, 2.0, 0.0) == pytest.approx((0.0, 2.0))
    assert ned_from_heading(math.pi / 2, 0.0, 2.0) == pytest.approx((-2.0, 0.0))
    assert ned_from_heading(math.radians(30), 2.0, 0.0) == pytest.approx((math.sqrt(3), 1.0))


def test_one_degree_on_the_ellipsoid() -> None:
    """At the equator a degree is 110,574 m north and 111,320 m east; at 60 N 111,412 and 55,800."""
    equator, north = Geodetic(0.0, 0.0, 0.0), Geodetic(60.0, 10.0, 100.0)
    ned = ned_from_geodetic(equator, Geodetic(1.0, 1.0, 0.0))
    assert ned[:2] == pytest.approx((110_574, 111_320), abs=1)
    ned = ned_from_geodetic(north, Geodetic(61.0, 11.0, 130.0))
    assert ned == pytest.approx((111_412, 55_800, -30.0), abs=1)


def test_places_survive_the_local_frame() -> None:
    origin = Geodetic(47.397742, 8.545594, 488.0)
    place = geodetic_from_ned(origin, 120.0, -340.0, -25.0)
    assert place.altitude == 513.0
    assert ned_from_geodetic(origin, place) == pytest.approx((120.0, -340.0, -25.0), abs=1e-6)
    across = ned_from_geodetic(Geodetic(0.0, 179.9999, 0.0), Geodetic(0.0, -179.9999, 0.0))
    assert across[1] == pytest.approx(22.26, abs=0.01)  # over the date line: 0.0002 degrees


def test_wrap() -> None:
    assert wrap(3 * math.pi / 2) == pytest.approx(-math.pi / 2)
    assert wrap(-3 * math.pi / 2) == pytest.approx(math.pi / 2)
    assert wrap(0.3) == pytest.approx(0.3)


@pytest.mark.parametrize("yaw", [0.0, 1.0, 2.5, -3.0])
def test_attitude_from_a_thrust_vector(yaw: float) -> None:
    """-z points along the thrust, and the nose has the heading."""
    force = np.array([2.0, -1.0, -9.0])
    q = np.empty(4)
    attitude_from_thrust(force, yaw, q)
    assert np.linalg.norm(q) == pytest.approx(1.0)
    assert rotated(q, (0, 0, -1)) == pytest.approx(force / np.linalg.norm(force))
    right = rotated(q, (0, 1, 0))  # level with the heading: perpendicular to the nose's direction
    assert right[0] * math.cos(yaw) + right[1] * math.sin(yaw) == pytest.approx(0, abs=1e-12)
