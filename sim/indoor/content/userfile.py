"""Worlds of the user's own: any glTF/GLB, OBJ or PLY file, through trimesh.

What a file must be: triangles in metres that close a room around every start: no flight may get
out (``sim.indoor.geometry.flood``), unless the caller says that the world is open; then leaving its
bounds ends a flight.  glTF is y-up by its
standard, OBJ and PLY are taken as z-up; x is east.  Base colours and their textures are kept, lamps
are not: every start gets one of ours above it, and the light is baked like ours.  Start poses are
found (or given by the caller of ``read``): level places with clearance all around, headed where
there is most room.

One line says what is wrong with a file: ``SceneError``.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.indoor.content.assembly import Charts, affine, chart_of, grow
from sim.indoor.content.naming import AS_IT_IS, FileOptions
from sim.indoor.content.scene import Scene, light
from sim.indoor.content.textures import mip_chain
from sim.indoor.errors import SceneError, checked_pose
from sim.indoor.flight.reward import windowed
from sim.indoor.geometry.collision import clearance
from sim.indoor.geometry.flood import find_leak
from sim.indoor.geometry.mesh import Doubles, Mesh, Words
from sim.indoor.render.camera import Camera, Renderer
from sim.indoor.render.lighting import Lamps
from sim.indoor.render.rays import cast_many

SUFFIXES = (".glb", ".gltf", ".obj", ".ply")
MAX_BYTES = 512 * 2**20  # of the file; about what 2 million triangles with textures take
MAX_TRIANGLES = 2_000_000
MAX_BAKED = 60_000  # triangles; larger worlds are lit by the direction of their surfaces alone
MAX_SIZE = 1000.0  # m, along an axis: float32 keeps 0.1 mm there
TEXTURE_SIDE = 512  # texels; larger pictures are reduced
HEIGHT = 1.5  # m above what is below, where flights start
CLEARANCE = 0.8  # m around a start
STARTS = 8
RAYS = 200  # from a start, that must all meet a surface
NED_FROM_Y_UP = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
NED_FROM_Z_UP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def read(path: str, options: FileOptions = AS_IT_IS, *, lit: bool = True) -> Scene:
    """The world in a file.

    Raises:
        SceneError: it will not do.
    """
    file = Path(path)
    corner, uv, pictures, picture = _triangles(file)
    mesh, charts = _mesh(corner, uv, pictures, picture)
    if not options.starts:
        poses = find_starts(mesh, path, open_=options.open)
    else:
        poses = np.array(
            [checked_pose((*p[:3], 0.0, 0.0, p[3]), "a start") for p in options.starts]
        )
    _check_inside(mesh, poses, path)
    if not options.open:
        _check_closed(mesh, poses, path)
    if lit and mesh.triangles <= MAX_BAKED:
        mesh, charts = _facing_rooms(mesh, charts)
        place = poses[:, :3] - np.array([0.0, 0.0, 0.4])
        lamps = Lamps(place, np.full((len(place), 3), 2.5))
        mesh = mesh._replace(light=light(path, mesh, charts, lamps, 1.5))
    elif lit:
        mesh = mesh._replace(light=_by_direction(charts))
    return Scene(path, mesh, poses, np.zeros((0, 6)), float(np.ptp(corner[..., 2])))


def check_file(file: Path) -> None:
    """See that there is such a file, of a kind and size that is read.

    Raises:
        SceneError: there is not.
    """
    if file.suffix.lower() not in SUFFIXES:
        raise SceneError(
            f"no scene {str(file)!r}: expected one of {_names()} or a file {', '.join(SUFFIXES)}"
        )
    if not file.is_file():
        raise SceneError(f"scene file {file} does not exist")
    size = file.stat().st_size
    if size == 0:
        raise SceneError(f"scene file {file} is empty")
    if size > MAX_BYTES:
        raise SceneError(
            f"scene file {file} has {size >> 20} MiB, more than the limit of {MAX_BYTES >> 20} MiB"
        )


def _triangles(
    file: Path,
) -> tuple[Doubles, Doubles, list[npt.NDArray[np.float64]], npt.NDArray[np.int64]]:
    """Corners (T, 3, 3) [NED], texture coordinates (T, 3, 2), pictures, and each triangle's."""
    check_file(file)
    import trimesh  # noqa: PLC0415  (60 MB that only this function needs)

    try:
        loaded: Any = trimesh.load_scene(file)
        parts = [part for part in loaded.dump() if isinstance(part, trimesh.Trimesh)]
    except Exception as error:  # readers of many formats fail in many ways
        raise SceneError(f"scene file {file} cannot be read: {error}") from error
    parts = [part for part in parts if len(part.faces)]
    count = sum(len(part.faces) for part in parts)
    if count == 0:
        raise SceneError(f"scene file {file} holds no triangles")
    if count > MAX_TRIANGLES:
        raise SceneError(
            f"scene file {file} has {count:,} triangles, more than the limit of {MAX_TRIANGLES:,}"
        )
    turn = NED_FROM_Y_UP if file.suffix.lower() in {".glb", ".gltf"} else NED_FROM_Z_UP
    corners, uvs, owners = [], [], []
    pictures: list[npt.NDArray[np.float64]] = []
    for part in parts:
        corners.append(np.asarray(part.vertices)[part.faces] @ turn.T)
        uv, image = _appearance(part)
        uvs.append(uv)
        owners.append(np.full(len(part.faces), len(pictures)))
        pictures.append(image)
    corner = np.concatenate(corners)
    if not np.isfinite(corner).all():
        raise SceneError(f"scene file {file} has coordinates that are not finite")
    span = float(np.ptp(corner.reshape(-1, 3), axis=0).max())
    if span > MAX_SIZE:
        raise SceneError(f"scene file {file} spans {span:.0f} m, more than {MAX_SIZE:.0f} m")
    return corner, np.concatenate(uvs), pictures, np.concatenate(owners)


def _names() -> str:
    from sim.indoor.content.scenes import NAMES  # noqa: PLC0415

    return ", ".join(NAMES)


def _appearance(part: Any) -> tuple[Doubles, npt.NDArray[np.float64]]:
    """Texture coordinates (F, 3, 2) and the picture (side, side, 3) of a part."""
    plain = np.zeros((len(part.faces), 3, 2))
    material = getattr(part.visual, "material", None)
    coordinates = getattr(part.visual, "uv", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if image is not None and coordinates is not None:
        side = min(TEXTURE_SIDE, 1 << int(np.ceil(np.log2(max(image.size)))))
        pixels = np.asarray(image.convert("RGB").resize((side, side))) / 255.0
        flipped = np.asarray(coordinates)[part.faces] * [1.0, -1.0] + [0.0, 1.0]
        return flipped, pixels
    tone = getattr(material, "main_color", None)
    if tone is None:
        tone = getattr(part.visual, "main_color", [180, 180, 180, 255])
    return plain, np.broadcast_to(np.asarray(tone)[:3] / 255.0, (1, 1, 3)).astype(np.float64)


def _mesh(
    corner: Doubles,
    uv: Doubles,
    pictures: list[npt.NDArray[np.float64]],
    picture: npt.NDArray[np.int64],
) -> tuple[Mesh, Charts]:
    """The arrays of a user's triangles: every triangle has a chart of its own."""
    edge, other = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(edge, other)
    size = np.linalg.norm(normal, axis=1)
    whole = size > 1e-10
    corner, uv, picture = corner[whole], uv[whole], picture[whole]
    edge, other, normal = edge[whole], other[whole], normal[whole] / size[whole, None]

    starts, chains, at = [], [], 0
    for image in pictures:
        chain = mip_chain(image)
        starts.append((at, int(np.log2(len(image)))))
        chains.append(chain)
        at += len(chain)
    texture = np.array(starts, np.int32)[picture]

    # gradients of the texture coordinates over the plane of the triangle
    across = np.cross(other, normal)
    across /= np.einsum("ij,ij->i", across, edge)[:, None]
    down = np.cross(normal, edge)
    down /= np.einsum("ij,ij->i", down, other)[:, None]
    step = uv[:, 1:] - uv[:, :1]  # (T, 2 edges, 2 coordinates)
    gradient = across[:, None] * step[:, 0, :, None] + down[:, None] * step[:, 1, :, None]
    constant = uv[:, 0] - np.einsum("tkj,tj->tk", gradient, corner[:, 0])
    paint = np.concatenate([gradient, constant[..., None]], axis=2)
    paint *= (1 << texture[:, 1]).astype(np.float64)[:, None, None]

    count = len(corner)
    shine, chart = np.zeros((count, 2, 4)), np.zeros((count, 3), np.int32)
    origin, right, below = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    first = 0
    for t in range(count):
        if count > MAX_BAKED:  # one value a triangle: two equal texels in each direction
            chart[t] = (4 * t, 2, 2)
            continue
        along = edge[t] / np.linalg.norm(edge[t])
        away = np.cross(normal[t], along)
        texel, columns, rows, steps = chart_of(corner[t], along, away)
        shine[t] = affine(along, texel, 1 / steps[0]), affine(away, texel, 1 / steps[1])
        chart[t] = (first, columns, rows)
        origin[t], right[t], below[t] = texel, along * steps[0], away * steps[1]
        first += columns * rows
    texels = first or 4 * count
    charts = Charts(origin, right, below, normal, chart.copy(), np.zeros(count, np.float32))
    mesh = grow(
        corner.astype(np.float32), paint.astype(np.float32), shine.astype(np.float32), texture,
        chart, np.concatenate(chains), np.full(texels, 0xD0D0D0, np.uint32), two_sided=True,
    )  # fmt: skip
    return mesh, charts


def _facing_rooms(mesh: Mesh, charts: Charts) -> tuple[Mesh, Charts]:
    """Turn every triangle's front to the side that has more room: files wind them either way.

    Light is baked on the front only.  Rays that escape count as no room.
    """
    fan = _sphere(24)
    count = mesh.triangles
    chart = np.searchsorted(charts.size[:, 0], mesh.chart[:, 0])  # of each triangle of the tree
    normal = charts.normal[chart]
    middle = mesh.corner.mean(axis=1).astype(np.float64)
    upward = np.sign(fan @ normal.T).T  # (T, 24) which side a ray leaves on
    origins = middle[:, None] + 0.01 * upward[..., None] * normal[:, None]
    rays = np.broadcast_to(fan, (count, *fan.shape)).reshape(-1, 3)
    distance, _ = cast_many(mesh, 0, origins.reshape(-1, 3), np.ascontiguousarray(rays))
    room = np.where(np.isfinite(distance), distance, 0.0).reshape(count, -1)
    back = (room * upward).sum(axis=1) < 0
    corner = mesh.corner.copy()
    corner[back] = corner[back][:, [0, 2, 1]]
    normals = charts.normal.copy()
    normals[chart[back]] *= -1
    return mesh._replace(corner=corner), replace(charts, normal=normals)


def _by_direction(charts: Charts) -> Words:
    """Light for worlds too large to bake: brighter where a surface looks up, never dark."""
    tilt = np.abs(charts.normal @ np.array([0.36, 0.48, 0.80]))
    grey = np.clip(120 + 110 * tilt, 0, 255).astype(np.uint32)
    return np.repeat(grey | grey << 8 | grey << 16, charts.size[:, 1] * charts.size[:, 2])


def _sphere(count: int) -> Doubles:
    """Directions spread evenly over the sphere."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def _escapes(mesh: Mesh, place: Doubles) -> bool:
    """Whether one of `RAYS` rays from a place meets nothing."""
    directions = _sphere(RAYS)
    _, triangle = cast_many(mesh, 0, np.tile(place, (RAYS, 1)), directions)
    return bool((triangle < 0).any())


def _check_inside(mesh: Mesh, poses: Doubles, path: str) -> None:
    low, high = mesh.box[mesh.root[0]].astype(np.float64).reshape(2, 3)
    for place in poses[:, :3]:
        if not ((low < place) & (place < high)).all():
            x, y, z = place
            raise SceneError(
                f"scene file {path}: the start at ({x:.1f}, {y:.1f}, {z:.1f}) lies outside of its "
                f"bounds, {np.round(low, 1).tolist()} to {np.round(high, 1).tolist()} m"
            )


def _check_closed(mesh: Mesh, poses: Doubles, path: str) -> None:
    for place in poses[:, :3]:
        hole = find_leak(mesh, place)
        if hole is not None:
            (x, y, z), (u, v, w) = place, hole
            raise SceneError(
                f"scene file {path} is not closed: a flight from ({x:.1f}, {y:.1f}, {z:.1f}) "
                f"leaves it near ({u:.1f}, {v:.1f}, {w:.1f}); close it there, or say {path}?open"
            )


def find_starts(mesh: Mesh, path: str, *, open_: bool = False) -> Doubles:
    """Up to `STARTS` poses inside the world, spread out: the first of a fixed sequence that fit.

    In an `open_` world there need be nothing above them, nor all around.
    """
    points = mesh.corner.reshape(-1, 3)
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    rng = np.random.default_rng(0)
    places = rng.uniform(low, high, (4000, 3))
    down = np.tile([0.0, 0.0, 1.0], (len(places), 1))
    below, _ = cast_many(mesh, 0, places, down)
    above, _ = cast_many(mesh, 0, places, -down)
    inside = np.isfinite(below) & (np.isfinite(above) | open_)
    half_open = int((np.isfinite(below) != np.isfinite(above)).sum())
    if half_open > inside.sum() and not open_:
        raise SceneError(f"scene file {path} is not closed: it lacks a floor or a ceiling")
    room = below + above
    inside &= room > 2 * CLEARANCE
    # at the usual height, in low rooms in the middle
    floor = places[:, 2] + below
    places[:, 2] = floor - np.minimum(HEIGHT, room / 2)
    eyes = Camera(height=45, width=45)
    renderer = Renderer(mesh, eyes, smooth=False)
    found: list[list[float]] = []
    open_places = 0
    for place in places[inside]:
        if len(found) == STARTS:
            break
        if any(np.hypot(place[0] - f[0], place[1] - f[1]) < 1.5 for f in found):
            continue
        if clearance(mesh, 0, place, 2 * CLEARANCE) < CLEARANCE:
            continue
        if not open_ and _escapes(mesh, place):
            open_places += 1
            if open_places > 200:
                break
            continue
        turns = np.arange(8) * (np.pi / 4)
        views = [windowed(renderer.look([*place, 0.0, 0.0, turn]).depth) for turn in turns]
        best = int(np.argmax(views))
        if views[best] > 0.1:  # 2 m ahead
            found.append([*place, 0.0, 0.0, float((turns[best] + np.pi) % (2 * np.pi) - np.pi)])
    if not found and open_places:
        raise SceneError(
            f"scene file {path} is not closed: rays leave it from all {open_places} places tried"
        )
    if not found:
        raise SceneError(
            f"scene file {path} has no place with {CLEARANCE} m of clearance to start at"
        )
    return np.array(found)
