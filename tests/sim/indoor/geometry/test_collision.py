"""The swept sphere and the clearance against geometry done by hand."""

import numpy as np
import pytest

from sim.indoor.content.scene import Scene
from sim.indoor.geometry.collision import clearance, sweep


def swept(scene: Scene, start: list[float], move: list[float], radius: float = 0.25) -> float:
    mesh = scene.mesh
    return float(
        sweep(mesh.corner, mesh.box, mesh.link, 0, np.array(start), np.array(move), radius)
    )


def test_against_a_wall(room: Scene) -> None:
    """From 1 m before the north wall (x = 8) a sphere of 0.25 m touches after 0.75 m."""
    assert swept(room, [7.0, 5.0, -1.5], [1.0, 0, 0]) == pytest.approx(0.75)
    assert swept(room, [7.0, 5.0, -1.5], [0.7, 0, 0]) == np.inf
    assert swept(room, [7.0, 5.0, -1.5], [-1.0, 0, 0]) == np.inf


def test_at_a_slant(room: Scene) -> None:
    """Only the part of the move towards the wall counts."""
    assert swept(room, [7.0, 5.0, -1.5], [1.5, 1.5, 0]) == pytest.approx(0.5)


def test_floor_and_ceiling(room: Scene) -> None:
    assert swept(room, [4.0, 5.0, -0.5], [0, 0, 0.5]) == pytest.approx(0.5)
    assert swept(room, [4.0, 5.0, -2.5], [0, 0, -0.5]) == pytest.approx(0.5)


def test_against_an_edge_and_a_corner(edge_world: Scene) -> None:
    """A unit box at the origin: its edges and corners are met as cylinders and balls."""
    # towards the vertical edge at (1, 1), along the diagonal, 2 m away from it
    start = [1 + np.sqrt(2), 1 + np.sqrt(2), -0.5]
    move = [-np.sqrt(2), -np.sqrt(2), 0]
    assert swept(edge_world, start, move) == pytest.approx((2 - 0.25) / 2)
    # towards the corner (1, 1, -1), along the space diagonal, 3 m away
    s = np.sqrt(3)
    assert swept(edge_world, [1 + s, 1 + s, -1 - s], [-s, -s, s]) == pytest.approx((3 - 0.25) / 3)
    # past the edge at a distance of more than the radius
    assert swept(edge_world, [-1.0, 1.3, -0.5], [3.0, 0, 0]) == np.inf
    assert swept(edge_world, [-1.0, 1.2, -0.5], [3.0, 0, 0]) < 1


def test_leaving_a_touch_is_free_going_deeper_is_not(room: Scene) -> None:
    assert swept(room, [7.8, 5.0, -1.5], [-0.4, 0, 0]) == np.inf
    assert swept(room, [7.8, 5.0, -1.5], [0.1, 0, 0]) == 0.0


@pytest.mark.statistical
def test_no_tunnelling(cluttered: Scene) -> None:
    """After any free move, and up to any contact, the sphere is clear of everything."""
    rng = np.random.default_rng(3)
    checked = 0
    for _ in range(300):
        start = rng.uniform([0.3, 0.3, -2.7], [7.7, 9.7, -0.3])
        if clearance(cluttered.mesh, 0, start, 1.0) < 0.25:
            continue
        move = rng.normal(size=3)
        share = min(swept(cluttered, list(start), list(move)), 1.0)
        for part in np.linspace(0, share, 15):
            assert clearance(cluttered.mesh, 0, start + part * move, 1.0) > 0.25 - 1e-6
        if share < 1.0:
            assert clearance(cluttered.mesh, 0, start + share * move, 1.0) < 0.25 + 1e-6
        checked += 1
    assert checked > 100


def test_clearance(room: Scene) -> None:
    assert clearance(room.mesh, 0, np.array([4.0, 5.0, -1.0]), 9.0) == pytest.approx(1.0)
    assert clearance(room.mesh, 0, np.array([7.5, 5.0, -1.5]), 9.0) == pytest.approx(0.5)
    assert clearance(room.mesh, 0, np.array([4.0, 5.0, -1.5]), 0.3) == pytest.approx(0.3)
