"""A world ready to fly in: its mesh with baked light, and the poses where flights may start.

``load(name)`` builds one of our own worlds or reads a user's file.  The light is baked at the first
use and kept in ``cache_dir()/light``, under the content it was baked from; a write is atomic, so
that several processes may bake at once, and a cache that cannot be written is done without.
"""

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from sim.indoor.content import scenes
from sim.indoor.content.assembly import NED_FROM_PLAN, Charts, assemble
from sim.indoor.content.naming import split
from sim.indoor.content.plan import Plan, Start, linear
from sim.indoor.geometry.mesh import Doubles, Mesh, Words
from sim.indoor.render import lighting
from sim.indoor.render.lighting import Lamps
from sim.kernels import cache_dir
from sim.notices import during

RECIPE = "1"  # change it when the same input should give another light


@dataclass(frozen=True, eq=False)
class Scene:
    """One world.  Two are the same if they are one object."""

    name: str
    mesh: Mesh
    starts: Doubles  # (S, 6) poses: x, y, z [m, NED], roll, pitch, yaw [rad]
    views: Doubles  # (V, 6) poses that show it well, may be none
    height: float  # m, floor to ceiling


def load(name: str, *, lit: bool = True) -> Scene:
    """One of our worlds by its name, or a .glb, .gltf, .obj or .ply file by its path and options.

    :mod:`sim.indoor.content.naming` says how options are written.  Without `lit` every surface is
    equally bright: for tests and for users in a hurry.  Asking again gives the same object, until
    the file changes.
    """
    file = Path(split(name)[0])
    stamp = file.stat().st_mtime_ns if not scenes.known(name) and file.is_file() else 0
    return _load(name, lit, stamp)


def check(name: str, start: int = 0) -> None:
    """See that there is such a world and start, before anything is built, baked or compiled.

    The start poses of a file are known when it has been read: of it only the existence is told.

    Raises:
        ValueError, OSError: there is not.
    """
    if scenes.known(name):
        check_start(name, start, len(scenes.plan(name).starts))
        return
    from sim.indoor.content import userfile  # noqa: PLC0415  (trimesh only where a file is read)

    userfile.check_file(Path(split(name)[0]))


def check_start(name: str, start: int, count: int) -> None:
    """See that a world with `count` start poses has this one.

    Raises:
        ValueError: it has not.
    """
    if not 0 <= start < count:
        raise ValueError(f"start {start} of {name}: expected 0 to {count - 1}")


@lru_cache(maxsize=8)
def _load(name: str, lit: bool, stamp: int) -> Scene:
    """`stamp` tells one state of a file from the next."""
    if scenes.known(name):
        return build(name, scenes.plan(name), lit=lit)
    from sim.indoor.content import userfile  # noqa: PLC0415  (trimesh only where a file is read)

    file, options = split(name)
    return replace(userfile.read(file, options, lit=lit), name=name)


def build(name: str, plan: Plan, *, lit: bool = True) -> Scene:
    """The world that a plan describes."""
    mesh, charts = assemble(plan.faces)
    if lit:
        place = np.array([[lamp.x, lamp.y, lamp.height] for lamp in plan.lamps]).reshape(-1, 3)
        power = [linear(lamp.colour) * lamp.power for lamp in plan.lamps]
        lamps = Lamps(place @ NED_FROM_PLAN.T, np.array(power).reshape(-1, 3))
        mesh = mesh._replace(light=light(name, mesh, charts, lamps, plan.exposure))
    return Scene(name, mesh, _poses(plan.starts), _poses(plan.views), plan.height)


def _poses(places: Sequence[Start]) -> Doubles:
    """Poses in NED of places on the plan."""
    rows = [[p.y, p.x, -p.height, 0.0, 0.0, np.radians(p.heading)] for p in places]
    return np.array(rows, np.float64).reshape(-1, 6)


def light(name: str, mesh: Mesh, charts: Charts, lamps: Lamps, exposure: float) -> Words:
    """The lightmap, from the cache or baked now."""
    digest = hashlib.sha256(f"{RECIPE} {exposure} {lamps.radius}".encode())
    for array in (mesh.corner, mesh.texture, mesh.texels, charts.size, charts.origin, charts.glow,
                  lamps.place, lamps.power):  # fmt: skip
        digest.update(np.ascontiguousarray(array).tobytes())
    file = cache_dir() / "light" / f"{digest.hexdigest()[:24]}.npz"
    try:
        with np.load(file) as kept:
            words: Words = kept["light"]
            if words.shape == mesh.light.shape and words.dtype == np.uint32:
                return words
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        pass  # not there, or not whole
    with during(f"baking the light of {name}, once"):
        words = lighting.bake(mesh, charts, lamps, exposure)
    _keep(file, words)
    return words


def _keep(file: Path, words: Words) -> None:
    """Write beside, then rename: readers see all of it or nothing."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, beside = tempfile.mkstemp(dir=file.parent, suffix=".part")
        with os.fdopen(handle, "wb") as stream:
            np.savez_compressed(stream, light=words)
        Path(beside).replace(file)
    except OSError:
        return  # a full or read-only disk costs the next start a few seconds, nothing else
