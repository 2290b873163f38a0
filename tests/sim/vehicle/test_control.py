"""The vehicle under control: steps within stated bounds, limits, weather, walls."""

import math

import numpy as np
import pytest

from sim.vehicle.control import Speeds
from sim.vehicle.frames import Doubles, wrap
from sim.vehicle.quadrotor import SLICE, Noise, Quadrotor, Weather
from sim.vehicle.setpoints import hold_at, nothing

SPEEDS = Speeds(5.0, 3.0, 1.5)


def hovering(**options: object) -> Quadrotor:
    body = Quadrotor(**options)  # type: ignore[arg-type]
    body.place(0.0, 0.0, -2.0, 0.0, flying=True)
    return body


def record(body: Quadrotor, target: Doubles, seconds: float) -> Doubles:
    """Positions, velocities and attitudes (T, 9), one row per 20 ms."""
    rows = []
    for _ in range(round(seconds / SLICE)):
        body.advance(target, SPEEDS)
        rows.append([*body.position, *body.velocity, *body.attitude])
    return np.array(rows)


def test_a_position_step_of_two_metres() -> None:
    """Within 10% after 3 s, overshoot under 15 cm, height kept to 10 cm, settled to 8 cm."""
    path = record(hovering(), hold_at(np.array([2.0, 0.0, -2.0]), 0.0), 8.0)
    assert abs(path[150, 0] - 2.0) < 0.2
    assert path[:, 0].max() < 2.15
    assert np.abs(path[:, 2] + 2.0).max() < 0.10
    assert np.abs(path[:, 1]).max() < 1e-6
    assert path[-1, 0:3] == pytest.approx((2.0, 0.0, -2.0), abs=0.08)


def test_a_velocity_step_of_one_metre_per_second() -> None:
    """90% within 1 s, overshoot under 10%, no sideways drift."""
    target = nothing()
    target[3:6], target[2], target[6] = (1.0, 0.0, 0.0), -2.0, 0.0
    path = record(hovering(), target, 4.0)
    assert path[50, 3] > 0.9
    assert path[:, 3].max() < 1.1
    assert path[-1, 3] == pytest.approx(1.0, abs=0.03)
    assert np.abs(path[:, 4]).max() < 1e-6


def test_a_climb_keeps_its_place() -> None:
    path = record(hovering(), hold_at(np.array([0.0, 0.0, -5.0])), 6.0)
    assert path[-1, 2] == pytest.approx(-5.0, abs=0.1)
    assert path[:, 2].min() > -5.2
    assert np.abs(path[:, 0:2]).max() < 1e-6


@pytest.mark.parametrize("yaw", [0.5, math.pi / 2, -2.0, math.pi])
def test_a_heading_step(yaw: float) -> None:
    """Reached to 3 degrees within 3 s, the short way round."""
    path = record(hovering(), hold_at(np.array([0.0, 0.0, -2.0]), yaw), 3.5)
    assert abs(wrap(path[-1, 8] - yaw)) < 0.05
    assert np.abs(path[:, 0:3] - (0, 0, -2)).max() < 0.05


def test_a_yaw_rate_turns_at_that_rate() -> None:
    target = hold_at(np.array([0.0, 0.0, -2.0]))
    target[7] = 0.5
    path = record(hovering(), target, 4.0)
    turned = wrap(path[-1, 8] - path[-51, 8])
    assert turned == pytest.approx(0.5, abs=0.02)


def test_speed_and_tilt_limits() -> None:
    target = nothing()
    target[3:6], target[6] = (40.0, 30.0, -20.0), 0.0
    path = record(hovering(), target, 8.0)
    speed = np.hypot(path[:, 3], path[:, 4])
    assert speed.max() < SPEEDS.horizontal * 1.05
    assert path[:, 5].min() > -SPEEDS.up * 1.1
    tilt = np.arccos(np.cos(path[:, 6]) * np.cos(path[:, 7]))
    assert tilt.max() < math.radians(45)


def test_wind_is_held_against() -> None:
    body = hovering(weather=Weather((3.0, -2.0, 0.0), gusts=0.5), seed=3)
    path = record(body, hold_at(np.array([0.0, 0.0, -2.0])), 20.0)
    assert np.abs(path[500:, 0:3] - (0, 0, -2)).max() < 0.4


def test_weather_and_noise_are_seeded() -> None:
    def flight(seed: int) -> Doubles:
        body = hovering(weather=Weather(gusts=1.0), noise=Noise(0.1, 0.05, 0.02), seed=seed)
        return record(body, hold_at(np.array([0.0, 0.0, -2.0])), 1.0)

    assert np.array_equal(flight(1), flight(1))
    assert not np.array_equal(flight(1), flight(2))


def test_noise_has_the_stated_size() -> None:
    """Correlated over 5 s: over 2,000 s the deviation is known to some 5%."""
    body = Quadrotor(noise=Noise(position=0.2), seed=5)
    errors = []
    for _ in range(100_000):
        body._weather_and_sensors()
        errors.append(body.position[0] - body.state[0])
    assert np.std(errors) == pytest.approx(0.2, rel=0.15)


def test_the_world_stops_it() -> None:
    """A wall 1 m ahead: a sphere of 0.25 m stops 0.75 m away; the impact has its speed."""

    class Wall:
        def reach(self, start: Doubles, move: Doubles, radius: float) -> float:
            gap = 1.0 - radius - start[0]
            return max(gap, 0.0) / move[0] if move[0] > max(gap, 0.0) else math.inf

        def floor(self, place: Doubles) -> float:
            return 0.0

    body = hovering(world=Wall())
    target = nothing()
    target[3:6], target[2] = (1.0, 0.0, 0.0), -2.0
    path = record(body, target, 3.0)
    assert path[:, 0].max() == pytest.approx(0.75, abs=1e-6)
    assert 0.8 < body.impact < 1.2


def test_rotors_off_means_falling() -> None:
    body = hovering()
    for _ in range(25):
        body.advance(None, SPEEDS)
    assert body.velocity[2] > 2.0
    for _ in range(100):
        body.advance(None, SPEEDS)
    assert body.on_ground
    assert body.impact > 4.0
