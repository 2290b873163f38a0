"""The camera against geometry done by hand, and against rays cast by NumPy."""

import numpy as np
import pytest

from sim.indoor.content.scene import Scene, build
from sim.indoor.content.textures import tiles
from sim.indoor.geometry.mesh import merge
from sim.indoor.render.camera import Camera, Renderer, inverse, rays
from tests.sim.indoor.conftest import bare_room

LEVEL = (0.0, 0.0)


def pixel_rays(camera: Camera, yaw: float) -> np.ndarray:
    """(H, W, 3) directions [NED] with length one along the optical axis, by the book."""
    across, down = camera.tangents
    x = across * (2 * (np.arange(camera.width) + 0.5) / camera.width - 1)
    y = down * (2 * (np.arange(camera.height) + 0.5) / camera.height - 1)
    forward, right = (
        np.array([np.cos(yaw), np.sin(yaw), 0]),
        np.array([-np.sin(yaw), np.cos(yaw), 0]),
    )
    down_axis = np.array([0.0, 0.0, 1.0])
    return np.asarray(forward + x[None, :, None] * right + y[:, None, None] * down_axis)


def nearest(corner: np.ndarray, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Distance along each ray to the nearest triangle: Moeller-Trumbore, all pairs."""
    a, ab, ac = corner[:, 0], corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    best = np.full(len(directions), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k, d in enumerate(directions):
            p = np.cross(d, ac)
            scale = 1 / (ab * p).sum(1)
            s = origin - a
            u = (s * p).sum(1) * scale
            q = np.cross(s, ab)
            v, t = (d * q).sum(1) * scale, (ac * q).sum(1) * scale
            hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 0)
            best[k] = t[hit].min() if hit.any() else np.inf
    return best


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.2, 2.9, -2.0])
def test_depth_of_a_room_is_that_of_its_six_planes(room: Scene, yaw: float) -> None:
    camera = Camera()
    eye = np.array([3.1, 4.2, -1.3])
    depth = Renderer(room.mesh, camera).look([*eye, *LEVEL, yaw]).depth
    rays = pixel_rays(camera, yaw)
    low, high = np.array([0.0, 0.0, -3.0]), np.array([8.0, 10.0, 0.0])  # north, east, down
    with np.errstate(divide="ignore"):
        expected = np.maximum((low - eye) / rays, (high - eye) / rays).min(axis=-1)
    assert np.abs(depth - expected).max() < 1e-3


def test_colour_and_handedness(room: Scene) -> None:
    """Looking north: the blue wall ahead; to the right (east) the green one, the floor below."""
    look = Renderer(room.mesh, Camera()).look
    north = look([4.0, 5.0, -1.5, 0, 0, 0.0]).rgb
    assert north[51, 51].argmax() == 2 and north[51, 51, 0] == 0
    east = look([4.0, 5.0, -1.5, 0, 0, np.pi / 2]).rgb
    assert east[51, 51].argmax() == 1 and east[51, 51, 0] == 0
    south = look([4.0, 5.0, -1.5, 0, 0, np.pi]).rgb
    assert south[51, 51].argmax() == 0 and south[51, 51, 2] == 0
    to_the_right = look([4.0, 8.0, -1.5, 0, 0, 0.6]).rgb
    assert to_the_right[51, 95].argmax() == 1, "east lies to the right of north"
    down = look([4.0, 5.0, -1.5, 0, -np.pi / 2, 0.0]).depth
    assert np.allclose(down, 1.5, atol=1e-3)
    rolled = look([4.0, 5.0, -1.5, np.pi, 0, 0.0]).depth  # upside down: the ceiling is below
    assert np.allclose(rolled[-1, 51], look([4.0, 5.0, -1.5, 0, 0, 0]).depth[0, 51], atol=1e-3)


def test_field_of_view() -> None:
    camera = Camera()
    assert np.degrees(2 * np.arctan(camera.tangents[0])) == pytest.approx(80.0)
    assert np.degrees(2 * np.arctan(camera.tangents[1])) == pytest.approx(50.53, abs=0.01)
    world_from_pixel = rays(np.zeros(6), 103, 103, camera.tangents)
    assert world_from_pixel @ [51, 51, 1] == pytest.approx([1, 0, 0])
    assert inverse(world_from_pixel) @ world_from_pixel == pytest.approx(np.eye(3))


@pytest.mark.statistical
def test_depth_agrees_with_rays(cluttered: Scene) -> None:
    """Random poses, also tilted ones; only pixels on a silhouette may differ."""
    rng = np.random.default_rng(1)
    camera = Camera(height=31, width=29)
    renderer = Renderer(cluttered.mesh, camera)
    corner = cluttered.mesh.corner.astype(np.float64)
    for _ in range(12):
        pose = np.array(
            [*rng.uniform([0.3, 0.3, -2.8], [7.7, 9.7, -0.2]), *rng.uniform(-1, 1, 3) * 3]
        )
        m = rays(pose, camera.height, camera.width, camera.tangents)
        y, x = np.mgrid[: camera.height, : camera.width]
        directions = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3) @ m.T
        depth = renderer.look(pose).depth.ravel()
        facing = np.einsum(
            "ij,ij->i", np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]),
            corner[:, 0] - pose[:3],
        ) < 0  # fmt: skip
        expected = nearest(corner[facing], pose[:3], directions)
        agree = np.isclose(depth, expected, rtol=1e-4, atol=1e-3)
        assert agree.mean() > 0.998
        assert np.isfinite(depth[np.isfinite(expected)]).all()


@pytest.mark.statistical
def test_closed_worlds_have_no_holes(world: Scene) -> None:
    """From many places, at odd angles: every pixel sees something, within the world."""
    rng = np.random.default_rng(2)
    renderer = Renderer(world.mesh, Camera(), smooth=False)
    widest = np.ptp(world.mesh.corner.reshape(-1, 3), axis=0)
    for start in world.starts:
        for _ in range(10):
            pose = start + rng.uniform(-1, 1, 6) * [0.5, 0.5, 0.5, 0.2, 0.2, 3.0]
            depth = renderer.look(pose).depth
            assert np.isfinite(depth).all()
            assert depth.max() <= np.linalg.norm(widest)


def test_near_walls_are_not_clipped(room: Scene) -> None:
    """With the eye a millimetre from a wall the wall still fills the picture."""
    depth = Renderer(room.mesh, Camera()).look([8.0 - 0.001, 5.0, -1.5, 0, 0, 0]).depth
    assert np.allclose(depth, 0.001, atol=1e-5)


def test_worlds_side_by_side_are_the_same_worlds(room: Scene, cluttered: Scene) -> None:
    both = merge([room.mesh, cluttered.mesh])
    pose = [2.0, 3.0, -1.5, 0, 0, 0.7]
    for index, scene in enumerate((room, cluttered)):
        alone, beside = Renderer(scene.mesh, Camera()), Renderer(both, Camera())
        assert np.array_equal(alone.look(pose).rgb, beside.look(pose, index).rgb)
        assert np.array_equal(alone.look(pose).depth, beside.look(pose, index).depth)


def test_far_texture_is_averaged() -> None:
    """Small black and white tiles are tiles when near, and grey, not a moire, when far."""
    plan = bare_room(floor=tiles("#ffffff", "#000000", joint="#808080", count=16, gloss=0.0))
    scene = build("tiles", plan, lit=False)
    rgb = Renderer(scene.mesh, Camera(), smooth=False).look([0.5, 5.0, -1.5, 0, 0, 0]).rgb
    near, far = rgb[100, 20:80, 0].astype(float), rgb[75:78, 20:80, 0].astype(float)
    assert near.std() > 50
    assert far.std() < 25 and 100 < far.mean() < 200
