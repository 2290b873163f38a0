"""No number crashes a kernel: pictures, sweeps, steps from NaN, infinities, huge and tiny ones."""

from itertools import product

import numpy as np
import pytest

from sim.indoor.content.scene import load
from sim.indoor.errors import FAR
from sim.indoor.flight.flights import RADIUS, Flights, Seen, step
from sim.indoor.geometry.collision import clearance, sweep
from sim.indoor.geometry.mesh import Doubles
from sim.indoor.render.camera import Camera, look
from sim.indoor.render.raster import canvas
from sim.indoor.render.rays import cast_many

SCENE = load("indoor-pyramid", lit=False)
EVIL = [
    np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324, -2e-308, 1e-30, 1e30, -1e300, 1.7e308, FAR, -FAR,
    1e5, 2.5, -1.5,
]  # fmt: skip


def poses(count: int, seed: int) -> Doubles:
    """(count, 6) poses: good ones in which evil numbers, or any 64 bits, stand here and there."""
    rng = np.random.default_rng(seed)
    good = SCENE.starts[rng.integers(len(SCENE.starts), size=count)]
    evil = rng.choice(EVIL, (count, 6))
    bits = rng.integers(0, 2**64, (count, 6), dtype=np.uint64).view(np.float64)
    kind = rng.choice(3, p=[0.8, 0.1, 0.1], size=(count, 6))
    return np.asarray(np.choose(kind, [good, evil, bits]))


def test_every_pose_gives_a_picture() -> None:
    camera = Camera()
    paper = canvas(camera.height, camera.width, SCENE.mesh.triangles)
    rgb, depth = np.empty((103, 103, 3), np.uint8), np.empty((103, 103), np.float32)
    seen = 0
    for pose in poses(3000, 1):
        look(paper, SCENE.mesh, 0, pose, camera.tangents, False, rgb, depth)
        assert (depth > 0).all()  # inf where nothing is, never NaN
        seen += bool(np.isfinite(depth).any())
    assert seen > 800  # numbers that are good are not refused


def test_a_pose_on_a_corner_an_edge_and_a_wall_gives_a_picture() -> None:
    camera = Camera()
    paper = canvas(camera.height, camera.width, SCENE.mesh.triangles)
    rgb, depth = np.empty((103, 103, 3), np.uint8), np.empty((103, 103), np.float32)
    corners = SCENE.mesh.corner[:: SCENE.mesh.triangles // 60].astype(np.float64)
    for triangle in corners:
        for place in (triangle[0], triangle[:2].mean(axis=0), triangle.mean(axis=0)):
            for turn in (0.0, np.pi / 2, 1.0):
                pose = np.array([*place, 0.0, 0.0, turn])
                look(paper, SCENE.mesh, 0, pose, camera.tangents, False, rgb, depth)
                assert (depth > 0).all()


def test_sweeps_rays_and_clearances_end() -> None:
    mesh = SCENE.mesh
    for pose in poses(3000, 2):
        start, move = pose[:3].copy(), pose[3:].copy()
        share = sweep(mesh.corner, mesh.box, mesh.link, mesh.root[0], start, move, RADIUS)
        assert share == np.inf or 0.0 <= share <= 1.0
        distance, triangle = cast_many(mesh, 0, start[None], move[None])
        assert (triangle[0] == -1) == (distance[0] == np.inf)
        assert not clearance(mesh, 0, start, 2.0) > 2.0


@pytest.mark.parametrize("flown", [False, True])
def test_every_step_ends_and_nothing_evil_is_rewarded(flown: bool) -> None:
    flights = Flights([SCENE], Camera())
    seen = Seen(flights.rgb, flights.depth, flights.reward, flights.touched, flights.crashed)
    for before, after in zip(poses(1500, 3), poses(1500, 4), strict=True):
        here, there = before[None].copy(), after[None].copy()
        step(
            flights._canvas, flights.mesh, flights.worlds, here, there, flown,
            np.array([12]), np.zeros((1, 2)), flights.camera.tangents, seen,
        )  # fmt: skip
        assert -1.0 <= flights.reward[0] <= 1.0
        if not np.isfinite(there).all():
            assert flights.crashed[0] and flights.reward[0] == -1.0


def test_every_action_from_every_evil_number() -> None:
    flights = Flights([SCENE], Camera(height=9, width=9))
    seen = Seen(flights.rgb, flights.depth, flights.reward, flights.touched, flights.crashed)
    for axis, number, action in product(range(6), EVIL, (0, 12, 24)):
        here = SCENE.starts[:1].copy()
        here[0, axis] = number
        there = here.copy()
        step(
            flights._canvas, flights.mesh, flights.worlds, here, there, False,
            np.array([action]), np.zeros((1, 2)), flights.camera.tangents, seen,
        )  # fmt: skip
        assert -1.0 <= flights.reward[0] <= 1.0
