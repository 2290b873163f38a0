"""The worlds that come with the house, and the light in them."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim import kernels, notices
from sim.indoor.content.plan import Plan
from sim.indoor.content.scene import Scene, build, load
from sim.indoor.content.scenes import NAMES
from sim.indoor.content.textures import mip_chain, plain
from sim.indoor.errors import SceneError
from sim.indoor.flight.reward import CRASH_THRESHOLD, windowed
from sim.indoor.geometry.collision import clearance
from sim.indoor.geometry.mesh import Words
from sim.indoor.geometry.shapes import face, triangulate
from sim.indoor.render import lighting
from sim.indoor.render.camera import Camera, Renderer
from sim.indoor.render.rays import cast_many
from tests.sim.indoor.conftest import WHITE, bare_room


def test_starts_have_clearance_and_a_way_ahead(world: Scene) -> None:
    assert len(world.starts) >= 8
    renderer = Renderer(world.mesh, Camera(), smooth=False)
    for start in world.starts:
        assert clearance(world.mesh, 0, start[:3].copy(), 2.0) >= 0.9
        assert windowed(renderer.look(start).depth) > 2 * CRASH_THRESHOLD


def test_worlds_are_closed_and_face_inwards(world: Scene) -> None:
    """From every start every ray meets a surface, from its front (leaves have two of them)."""
    rng = np.random.default_rng(0)
    for start in world.starts:
        directions = rng.normal(size=(200, 3))
        distance, t = cast_many(world.mesh, 0, np.tile(start[:3], (200, 1)), directions)
        assert np.isfinite(distance).all()
        a, b, c = (world.mesh.corner[t, k].astype(float) for k in range(3))
        assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), directions) < 0).mean() > 0.97


def test_worlds_differ() -> None:
    """The mean colours of what the starts see lie apart."""
    tones = {}
    for name in NAMES:
        world = load(name, lit=False)
        look = Renderer(world.mesh, Camera(), smooth=False).look
        tones[name] = np.mean([look(s).rgb.mean(axis=(0, 1)) for s in world.starts], axis=0)
    names = list(tones)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            assert np.linalg.norm(tones[a] - tones[b]) > 8, (a, b)


def test_a_world_is_loaded_once() -> None:
    assert load("indoor-techno", lit=False) is load("indoor-techno", lit=False)


def test_unknown_names_are_refused_in_one_line() -> None:
    with pytest.raises(SceneError, match="no scene 'indoor-attic': expected one of indoor-long"):
        load("indoor-attic")


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def lamp_room() -> Plan:
    plan = bare_room(4, 4)
    plan.island([(1.5, 1.5), (2.5, 1.5), (2.5, 2.5), (1.5, 2.5)], walls=WHITE)
    plan.lamp(0.7, 0.7)
    return plan


def test_light_falls_off_and_casts_shadows(own_cache: Path) -> None:
    lit = build("lamps", lamp_room())
    look = Renderer(lit.mesh, Camera(height=40, width=40)).look

    def floor(east: float, north: float) -> float:
        """Mean brightness of the floor seen from just above."""
        return float(look([north, east, -0.4, 0, -np.pi / 2, 0]).rgb.mean())

    assert floor(0.7, 0.7) > floor(3.3, 0.7) > floor(3.5, 3.5) > 0


def test_light_is_baked_once(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    bake = lighting.bake

    def telling(*arguments: Any) -> Words:
        told.append(notices.under_way())
        return bake(*arguments)

    monkeypatch.setattr(lighting, "bake", telling)
    first = build("lamps", lamp_room())
    again = build("lamps", lamp_room())
    assert told == ["baking the light of lamps, once"] and notices.under_way() == ""
    assert np.array_equal(first.mesh.light, again.mesh.light)
    assert len(list(own_cache.rglob("*.npz"))) == 1 and not list(own_cache.rglob("*.part"))


def test_a_broken_cache_is_baked_again(own_cache: Path) -> None:
    whole = build("lamps", lamp_room())
    (file,) = own_cache.rglob("*.npz")
    file.write_bytes(file.read_bytes()[:100])
    assert np.array_equal(build("lamps", lamp_room()).mesh.light, whole.mesh.light)


def test_without_a_writable_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A home that cannot be written (here: a file stands in the way) is done without."""
    (tmp_path / "blocked").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "blocked"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = kernels.cache_dir()
    assert folder.parent == tmp_path and folder == kernels.cache_dir()
    folder.chmod(0o777)  # others may write: not to be trusted with compiled code
    assert kernels.cache_dir() != folder


def test_concave_faces_are_cut_into_their_area() -> None:
    """An L of 3 square metres."""
    corners = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
    shape = face(corners, WHITE)
    area = 0.0
    for i, j, k in triangulate(shape.points, shape.normal):
        a, b, c = shape.points[[i, j, k]]
        normal = np.cross(b - a, c - a)
        assert normal @ shape.normal > 0
        area += float(np.linalg.norm(normal)) / 2
    assert area == pytest.approx(3.0)


def test_mip_levels_average_light() -> None:
    """Black and white pixels average to half the light, which is 186 of 255."""
    chain = mip_chain(np.indices((4, 4)).sum(axis=0)[..., None] % 2 * np.ones(3))
    assert len(chain) == 16 + 4 + 1
    assert chain[-1] & 255 == pytest.approx(186, abs=1)
    assert plain("#102030").paint()[0, 0] * 255 == pytest.approx([16, 32, 48])
