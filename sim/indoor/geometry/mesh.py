"""What the kernels read: triangles, their textures, light and the tree over them, in flat arrays.

One ``Mesh`` may hold several worlds side by side, each under its own root (``merge``), so that a
batch of drones in different worlds is still one compiled call.

Frame: NED metres, x north, y east, z down; the floor of our own worlds is z = 0, so heights are
negative z.  Texture and light coordinates are affine functions of the position (every triangle is
flat), kept as four numbers ``g`` with ``coordinate = g[:3] . position + g[3]``, in texels.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]
Words = npt.NDArray[np.uint32]


class Mesh(NamedTuple):
    """The arrays of one or several worlds.  T triangles, N tree nodes."""

    corner: Floats  # (T, 3, 3) corners [m, NED], in the order of the tree's leaves
    paint: Floats  # (T, 2, 4) texture coordinates [texels of the finest level]
    shine: Floats  # (T, 2, 4) lightmap coordinates [texels], the chart's first texel centre is 0
    texture: Ints  # (T, 2) first texel in `texels`, log2 of the side
    chart: Ints  # (T, 3) first texel in `light`, columns, rows
    box: Floats  # (N, 6) node bounds: three minima, three maxima [m]
    link: Ints  # (N, 2) inner node: left child, 0; leaf: first triangle, number of triangles
    root: Ints  # (W,) root node of each world
    two_sided: npt.NDArray[np.bool_]  # (W,) whether back faces are drawn
    texels: Words  # 0x00BBGGRR, every mip level after the other, finest first
    light: Words  # 0x00BBGGRR, gamma encoded, 128 = one

    @property
    def triangles(self) -> int:
        return len(self.corner)


def merge(meshes: list[Mesh]) -> Mesh:
    """Worlds side by side; world ``i`` of the result is ``meshes[i]``."""
    if len(meshes) == 1:
        return meshes[0]
    texture, chart, link, root = [], [], [], []
    triangles = nodes = texels = lights = 0
    for mesh in meshes:
        texture.append(mesh.texture + np.array([texels, 0], np.int32))
        chart.append(mesh.chart + np.array([lights, 0, 0], np.int32))
        leaf = mesh.link[:, 1:] > 0
        shift = np.where(leaf, triangles, nodes).astype(np.int32)
        link.append(np.concatenate([mesh.link[:, :1] + shift, mesh.link[:, 1:]], axis=1))
        root.append(mesh.root + np.int32(nodes))
        triangles += mesh.triangles
        nodes += len(mesh.box)
        texels += len(mesh.texels)
        lights += len(mesh.light)
    return Mesh(
        corner=np.concatenate([mesh.corner for mesh in meshes]),
        paint=np.concatenate([mesh.paint for mesh in meshes]),
        shine=np.concatenate([mesh.shine for mesh in meshes]),
        texture=np.concatenate(texture),
        chart=np.concatenate(chart),
        box=np.concatenate([mesh.box for mesh in meshes]),
        link=np.concatenate(link),
        root=np.concatenate(root),
        two_sided=np.concatenate([mesh.two_sided for mesh in meshes]),
        texels=np.concatenate([mesh.texels for mesh in meshes]),
        light=np.concatenate([mesh.light for mesh in meshes]),
    )
