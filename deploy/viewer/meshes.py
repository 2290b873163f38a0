"""The mesh of an indoor world as every view draws it: without its ceiling, in its own colours.

Frame: NED metres, as the worlds are.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from sim.indoor.content.textures import GAMMA
from sim.indoor.geometry.mesh import Mesh
from sim.indoor.render.lighting import albedo_of

CEILING = 0.35  # [m] what lies so close below the highest point is taken off
SHADE = (0.35, 0.6, 0.85)  # brightness of faces that look north, east, down: a guess


@dataclass(frozen=True, slots=True, eq=False)
class OpenMesh:
    """What is drawn of a world.

    Attributes:
        corners: (T, 3, 3) of its triangles, without the ceiling [m].
        paint: (T, 3) their colours.
    """

    corners: NDArray[np.float32]
    paint: NDArray[np.uint8]

    @classmethod
    def of(cls, mesh: Mesh) -> Self:
        """What is drawn of a world with this mesh."""
        top = mesh.corner[..., 2].min() + CEILING
        shown = (mesh.corner[..., 2] > top).any(axis=1)
        return cls(mesh.corner[shown], _face_colours(mesh)[shown])

    def drawn(self) -> rr.Mesh3D:
        """For Rerun."""
        count = len(self.corners)
        return rr.Mesh3D(
            vertex_positions=self.corners.reshape(-1, 3),
            triangle_indices=np.arange(3 * count).reshape(-1, 3),
            vertex_colors=np.repeat(self.paint, 3, axis=0),
        )


def _face_colours(mesh: Mesh) -> NDArray[np.uint8]:
    """(T, 3) mean colour of every triangle, shaded by where it faces: there is no lamp."""
    edges = mesh.corner[:, 1:] - mesh.corner[:, :1]
    normal = np.cross(edges[:, 0], edges[:, 1]).astype(np.float64)
    normal = np.abs(normal) / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return np.asarray(255 * albedo_of(mesh) ** (1 / GAMMA) * (normal @ SHADE)[:, None], np.uint8)
