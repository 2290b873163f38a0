"""A vehicle in a scene: home is on the floor, walls bar the way, tables may be landed on."""

import numpy as np
import pytest

from sim.indoor.flight.flights import RADIUS
from sim.vehicle.control import Speeds
from sim.vehicle.quadrotor import Quadrotor
from sim.vehicle.rooms import Room
from sim.vehicle.setpoints import hold_at, nothing

SPEEDS = Speeds(2.0, 1.5, 1.0)
DOWN = nothing()
DOWN[5] = 0.5


@pytest.fixture(scope="module")
def room() -> Room:
    return Room("indoor-long")


def fly(body: Quadrotor, target: object, seconds: float) -> None:
    for _ in range(round(seconds / 0.02)):
        body.advance(target, SPEEDS)  # type: ignore[arg-type]


def test_home_is_on_the_floor_below_a_start(room: Room) -> None:
    assert room.home[:3] == pytest.approx((4.0, 2.3, 0.0), abs=0.01)
    assert Room("indoor-long", 1).home.yaw == pytest.approx(np.pi / 2)
    assert room.floor(np.array([0.0, 0.0, -1.5])) == pytest.approx(0.0, abs=0.01)
    assert room.floor(np.array([500.0, 0.0, -1.5])) == 0.0  # outside there is nothing below
    with pytest.raises(ValueError, match="start 99 of indoor-long: expected 0 to"):
        Room("indoor-long", 99)


def test_it_takes_off_and_lands_where_it_stood(room: Room) -> None:
    body = Quadrotor(world=room, yaw=room.home.yaw)
    assert body.on_ground
    fly(body, hold_at(np.array([0.0, 0.0, -1.5])), 5.0)
    assert body.position == pytest.approx((0.0, 0.0, -1.5), abs=0.1)
    assert not body.touching
    fly(body, DOWN, 5.0)
    assert body.on_ground
    assert body.impact < 0.7


def test_a_wall_bars_the_way(room: Room) -> None:
    body = Quadrotor(world=room)
    body.place(0.0, 0.0, -1.5, 0.0, flying=True)
    target = nothing()
    target[3:6], target[2] = (0.0, -1.0, 0.0), -1.5  # west, where the outer wall is 2.3 m away
    fly(body, target, 6.0)
    assert body.touching
    assert body.position[1] + room.home.y == pytest.approx(RADIUS, abs=0.01)
    assert 0.5 < body.impact < 1.5


def test_it_can_stand_on_furniture(room: Room) -> None:
    """Somewhere around there is a flat top with nothing higher beside it."""
    around = [(dx, dy) for dx in (-0.35, 0.0, 0.35) for dy in (-0.35, 0.0, 0.35)]

    def height(x: float, y: float) -> float:
        return -room.floor(np.array([x, y, -2.0]))

    x, y, top = next(
        (x, y, height(x, y))
        for x in np.arange(-3.0, 9.0, 0.1)
        for y in np.arange(-2.0, 50.0, 0.1)
        if 0.3 < height(x, y) < 1.2
        and all(height(x + dx, y + dy) < height(x, y) + 0.01 for dx, dy in around)
        and abs(height(x + 0.1, y) - height(x, y)) < 0.01
    )
    body = Quadrotor(world=room)
    body.place(x, y, -2.0, 0.0, flying=True)
    fly(body, DOWN, 6.0)
    assert body.on_ground
    assert -body.position[2] == pytest.approx(top + body.airframe.legs, abs=1e-3)
