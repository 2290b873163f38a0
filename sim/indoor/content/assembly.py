"""From faces to the arrays that the kernels read: triangles, textures, lightmap charts, the tree.

Every face owns one chart: a small picture of the light on it, in its own plane, with a texel about
every `TEXEL` metres and at least two in each direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.indoor.content.textures import Material, mip_chain
from sim.indoor.geometry import bvh
from sim.indoor.geometry.mesh import Doubles, Floats, Ints, Mesh, Words
from sim.indoor.geometry.shapes import Face, triangulate

TEXEL = 0.3  # m; finer shadows cost baking time in proportion to its square
NED_FROM_PLAN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True)
class Charts:
    """Where the texels of the lightmap lie in the world, one row a chart [m, NED]."""

    origin: Doubles  # (C, 3) the first texel
    across: Doubles  # (C, 3) from one column to the next
    downward: Doubles  # (C, 3) from one row to the next
    normal: Doubles  # (C, 3) unit, towards the side that is seen
    size: Ints  # (C, 3) first texel in the lightmap, columns, rows
    glow: Floats  # (C,) light that the face shows by itself

    @property
    def texels(self) -> int:
        return int(self.size[-1, 0] + self.size[-1, 1] * self.size[-1, 2]) if len(self.size) else 0


def affine(direction: Doubles, origin: Doubles, scale: float) -> Doubles:
    """(4,) coefficients of position -> scale * (position - origin) . direction."""
    return np.append(direction, -float(direction @ origin)) * scale


def _stretched(coordinate: Doubles, points: Doubles, texels: int) -> Doubles:
    """An affine coordinate scaled and moved so that it spans 0..texels over the points."""
    value = points @ coordinate[:3]
    wide = coordinate * (texels / np.ptp(value))
    wide[3] = -value.min() * (texels / np.ptp(value))
    return wide


def chart_of(points: Doubles, along: Doubles, down: Doubles) -> tuple[Doubles, int, int, Doubles]:
    """A chart over points in a plane: first texel, columns, rows, and the steps (2,) in metres."""
    u, v = points @ along, points @ down
    columns = max(2, int(np.ceil(np.ptp(u) / TEXEL)) + 1)
    rows = max(2, int(np.ceil(np.ptp(v) / TEXEL)) + 1)
    steps = np.array([max(np.ptp(u), 1e-6) / (columns - 1), max(np.ptp(v), 1e-6) / (rows - 1)])
    anchor = points[0]
    origin = anchor + along * (u.min() - anchor @ along) + down * (v.min() - anchor @ down)
    return origin, columns, rows, steps


def paint_box(materials: Sequence[Material]) -> tuple[dict[str, tuple[int, int]], Words]:
    """Every picture once: key -> (first texel, log2 of its side), and all texels."""
    place: dict[str, tuple[int, int]] = {}
    chains, at = [], 0
    for material in materials:
        if material.key in place:
            continue
        image = material.paint()
        chain = mip_chain(image)
        place[material.key] = (at, int(np.log2(len(image))))
        chains.append(chain)
        at += len(chain)
    return place, np.concatenate(chains)


def assemble(faces: list[Face]) -> tuple[Mesh, Charts]:
    """The mesh of a world, evenly lit, and the charts to bake its light into."""
    place, texels = paint_box([face.material for face in faces])
    corner, paint, shine, texture, chart = [], [], [], [], []
    origins, across, downward, normals, sizes, glow = [], [], [], [], [], []
    first = 0
    for face in faces:
        points = face.points @ NED_FROM_PLAN.T
        along, down = NED_FROM_PLAN @ face.along, NED_FROM_PLAN @ face.down
        origin = NED_FROM_PLAN @ face.origin
        start, side = place[face.material.key]
        scale = (1 << side) / face.material.metres
        u, v = affine(along, origin, scale), affine(down, origin, scale)
        if face.fit:
            u, v = _stretched(u, points, 1 << side), _stretched(v, points, 1 << side)
        corner_texel, columns, rows, steps = chart_of(points, along, down)
        a, b = affine(along, corner_texel, 1 / steps[0]), affine(down, corner_texel, 1 / steps[1])
        for i, j, k in triangulate(face.points, face.normal):
            corner.append(points[[i, j, k]])
            paint.append([u, v])
            shine.append([a, b])
            texture.append([start, side])
            chart.append([first, columns, rows])
        origins.append(corner_texel)
        across.append(along * steps[0])
        downward.append(down * steps[1])
        normals.append(NED_FROM_PLAN @ face.normal)
        sizes.append([first, columns, rows])
        glow.append(face.material.glow)
        first += columns * rows
    charts = Charts(
        origin=np.array(origins),
        across=np.array(across),
        downward=np.array(downward),
        normal=np.array(normals),
        size=np.array(sizes, np.int32),
        glow=np.array(glow, np.float32),
    )
    mesh = grow(
        np.array(corner, np.float32),
        np.array(paint, np.float32),
        np.array(shine, np.float32),
        np.array(texture, np.int32),
        np.array(chart, np.int32),
        texels,
        np.full(first, 0xD0D0D0, np.uint32),
        two_sided=False,
    )
    return mesh, charts


def grow(
    corner: Floats,
    paint: Floats,
    shine: Floats,
    texture: Ints,
    chart: Ints,
    texels: Words,
    light: Words,
    *,
    two_sided: bool,
) -> Mesh:
    """Plant the tree and put the triangles into its order."""
    order, box, link = bvh.build(corner)
    return Mesh(
        corner=np.ascontiguousarray(corner[order]),
        paint=np.ascontiguousarray(paint[order]),
        shine=np.ascontiguousarray(shine[order]),
        texture=np.ascontiguousarray(texture[order]),
        chart=np.ascontiguousarray(chart[order]),
        box=box,
        link=link,
        root=np.zeros(1, np.int32),
        two_sided=np.array([two_sided]),
        texels=texels,
        light=light,
    )
