"""Worlds from files: round trips through trimesh, found starts, and one line for what is wrong."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import trimesh as untyped_trimesh

from sim.indoor.content import userfile
from sim.indoor.content.naming import join
from sim.indoor.content.scene import load
from sim.indoor.errors import SceneError
from sim.indoor.geometry.collision import clearance
from sim.indoor.geometry.flood import free_edges
from sim.indoor.render.camera import Camera, Renderer

trimesh: Any = untyped_trimesh
PLAN_FROM_Y_UP = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])


def hall(lid: bool = True, length: float = 12.0) -> Any:
    """A hall of 12 x 8 x 3 m, z up, x east, with a block in it; without its lid it is open."""
    shell = trimesh.creation.box(bounds=[[0, 0, 0], [length, 8, 3]])
    if not lid:
        shell.update_faces(shell.triangles_center[:, 2] < 2.9)
    return trimesh.util.concatenate([shell, trimesh.creation.box(bounds=[[5, 3, 0], [7, 5, 2]])])


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply"])
def test_every_format_gives_the_same_world(tmp_path: Path, suffix: str) -> None:
    mesh = hall()
    if suffix == ".glb":
        mesh.apply_transform(np.linalg.inv(PLAN_FROM_Y_UP))
    path = tmp_path / f"hall{suffix}"
    mesh.export(path)
    scene = userfile.read(str(path), lit=False)
    points = scene.mesh.corner.reshape(-1, 3)
    assert points.min(axis=0) == pytest.approx([0, 0, -3], abs=1e-5)  # north, east, down
    assert points.max(axis=0) == pytest.approx([8, 12, 0], abs=1e-5)
    assert len(scene.starts) == userfile.STARTS
    for start in scene.starts:
        assert clearance(scene.mesh, 0, start[:3].copy(), 2.0) >= userfile.CLEARANCE
        assert start[2] == pytest.approx(-1.5, abs=1e-6) or start[2] < -2.0  # or above the block
    depth = Renderer(scene.mesh, Camera()).look([1.0, 6.0, -1.5, 0, 0, 0]).depth
    assert depth[51, 51] == pytest.approx(2.0, abs=1e-3)  # the block's south side


def test_one_flies_in_it(tmp_path: Path) -> None:
    path = tmp_path / "hall.ply"
    hall().export(path)
    env = gymnasium.make("sim:IndoorFlight-v0", scene=str(path))
    env.reset(seed=0)
    assert env.step(12)[4]["distance"] == pytest.approx(0.4)


def test_textures_keep_their_place(tmp_path: Path) -> None:
    """A picture that is red on its left half and blue on its right, once around each wall."""
    image = pytest.importorskip("PIL.Image")
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:, :32, 0], pixels[:, 32:, 2] = 255, 255
    wall = trimesh.Trimesh(
        [[0, 8, 0], [12, 8, 0], [12, 8, 3], [0, 8, 3]], [[0, 2, 1], [0, 3, 2]], process=False
    )
    wall.visual = trimesh.visual.TextureVisuals(
        uv=[[0, 0], [1, 0], [1, 1], [0, 1]],
        material=trimesh.visual.material.PBRMaterial(baseColorTexture=image.fromarray(pixels)),
    )
    path = tmp_path / "wall.glb"
    scene = trimesh.Scene([hall(), wall.apply_translation([0, -0.5, 0])])
    scene.apply_transform(np.linalg.inv(PLAN_FROM_Y_UP))
    scene.export(path)
    world = userfile.read(str(path), lit=False)
    rgb = Renderer(world.mesh, Camera()).look([5.5, 9.0, -1.5, 0, 0, 0]).rgb
    assert rgb[51, 51].argmax() == 2
    rgb = Renderer(world.mesh, Camera()).look([5.5, 3.0, -1.5, 0, 0, 0]).rgb
    assert rgb[51, 51].argmax() == 0


def test_files_are_lit_whichever_way_they_are_wound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rooms modelled as boxes face outwards; their walls are bright inside all the same."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    pictures = []
    for name, turned in (("out.ply", False), ("in.ply", True)):
        mesh = hall()
        if turned:
            mesh.invert()
        mesh.export(tmp_path / name)
        world = userfile.read(str(tmp_path / name))
        pictures.append(Renderer(world.mesh, Camera()).look([1.0, 6.0, -1.5, 0, 0, 0]).rgb)
    for rgb in pictures:
        assert rgb.mean() > 60
        assert (rgb.max(axis=2) > 20).mean() > 0.95


def test_given_starts(tmp_path: Path) -> None:
    path = tmp_path / "hall.ply"
    hall().export(path)
    scene = load(f"{path}?starts=1,6,-1.5,0.5", lit=False)
    assert scene.starts == pytest.approx(np.array([[1.0, 6.0, -1.5, 0, 0, 0.5]]))
    assert join(str(path), {"starts": [(1, 6, -1.5, 0.5)]}) == f"{path}?starts=1.0,6.0,-1.5,0.5"
    with pytest.raises(SceneError, match=r"the start at \(1.0, 20.0, -1.5\) lies outside"):
        load(f"{path}?starts=1,20,-1.5,0.5", lit=False)


def window(side: float) -> Any:
    """The hall with a square hole in its north wall, around x (east) 3 m, 1.5 m above the floor."""
    mesh = hall()
    for _ in range(5):
        mesh = mesh.subdivide()
    east, north, up = mesh.triangles_center.T
    hole = (abs(east - 3) < side / 2) & (abs(up - 1.5) < side / 2) & (north > 7.9)
    mesh.update_faces(~hole)
    return mesh


def test_a_hole_is_found_and_can_be_allowed_by_name(tmp_path: Path) -> None:
    """A flight through it ends as a crash where the world ends; it earned 1000 before."""
    path = tmp_path / "window.ply"
    window(1.0).export(path)
    line = refusal(path)
    assert "is not closed: a flight from" in line and f"or say {path}?open" in line
    place = line.partition("leaves it near (")[2].partition(")")[0]
    assert np.array(place.split(", "), float) == pytest.approx([8, 3, -1.5], abs=1.0)
    env = gymnasium.make("sim:IndoorFlight-v0", scene=str(path), scene_options={"open": True})
    env.reset(seed=0, options={"pose": (6.0, 3.0, -1.5, 0.0)})
    crashed, steps = False, 0
    while not crashed:
        _, reward, crashed, _, info = env.step(12)
        steps += 1
        assert steps < 10
    assert reward == -1.0 and not info["touched"]
    assert 8.0 < info["pose"][0] < 8.5


def test_walls_that_are_not_welded_close_a_world_too(tmp_path: Path) -> None:
    """One wall in finer pieces than the floor it stands on: free edges, and no hole."""
    shell = trimesh.creation.box(bounds=[[0, 0, 0], [12, 8, 3]])
    north = shell.triangles_center[:, 1] > 7.9
    wall = shell.submesh([north], append=True).subdivide().subdivide()
    shell.update_faces(~north)
    trimesh.util.concatenate([shell, wall]).export(tmp_path / "hall.ply")
    scene = userfile.read(str(tmp_path / "hall.ply"), lit=False)
    assert len(scene.starts) and len(free_edges(scene.mesh))


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("shut", 'unknown option "shut"'),
        ("open=maybe", "open = 'maybe', expected true or false"),
        ("starts=1,2", "expected x,y,z,yaw"),
        ("starts=1,2,-1,nan", "a start: yaw = nan: expected a finite number"),
    ],
)
def test_options_in_a_name_are_checked(tmp_path: Path, query: str, said: str) -> None:
    hall().export(tmp_path / "hall.ply")
    with pytest.raises(ValueError, match=said):
        load(f"{tmp_path / 'hall.ply'}?{query}", lit=False)


def refusal(path: Path) -> str:
    with pytest.raises(SceneError) as caught:
        userfile.read(str(path), lit=False)
    line = str(caught.value)
    assert "\n" not in line
    return line


def test_files_that_are_no_worlds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "does not exist" in refusal(tmp_path / "nothing.glb")

    (tmp_path / "empty.glb").write_bytes(b"")
    assert "is empty" in refusal(tmp_path / "empty.glb")

    (tmp_path / "noise.glb").write_bytes(bytes(range(256)) * 4)
    assert "cannot be read" in refusal(tmp_path / "noise.glb")

    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    assert "no triangles" in refusal(tmp_path / "points.obj")

    hall(lid=False).export(tmp_path / "open.ply")
    assert "not closed" in refusal(tmp_path / "open.ply")

    trimesh.creation.box(extents=[0.5, 0.5, 0.5]).export(tmp_path / "tiny.ply")
    assert "clearance" in refusal(tmp_path / "tiny.ply")

    trimesh.creation.box(extents=[5000, 10, 10]).export(tmp_path / "huge.ply")
    assert "spans 5000 m" in refusal(tmp_path / "huge.ply")

    hall().export(tmp_path / "hall.ply")
    monkeypatch.setattr(userfile, "MAX_TRIANGLES", 10)
    assert "24 triangles, more than the limit of 10" in refusal(tmp_path / "hall.ply")
    monkeypatch.setattr(userfile, "MAX_BYTES", 100)
    assert "more than the limit" in refusal(tmp_path / "hall.ply")
    assert "no scene" in refusal(tmp_path / "hall.stl")
