"""Indoor worlds as the viewer draws them: the mesh without its ceiling, seen from above.

Frame: NED metres, as the worlds are; Rerun is told that z points down.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from deploy.viewer import colours
from sim.indoor.content.scene import Scene
from sim.indoor.content.textures import GAMMA
from sim.indoor.geometry.mesh import Mesh
from sim.indoor.render.lighting import albedo_of

CEILING = 0.3  # [m] what lies so close below the highest point is taken off
SHADE = (0.35, 0.6, 0.85)  # brightness of faces that look north, east, down: a guess
THICK = 0.2  # [m] radius of paths


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """An indoor world.

    Attributes:
        corners: (T, 3, 3) of its triangles, without the ceiling [m].
        paint: (T, 3) their colours.
    """

    corners: NDArray[np.float32]
    paint: NDArray[np.uint8]

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """The picture of a world."""
        corner = scene.mesh.corner
        top = corner[..., 2].min() + CEILING
        shown = (corner[..., 2] > top).any(axis=1)
        return cls(corner[shown], face_colours(scene.mesh)[shown])

    def still(self, colour: colours.Colour) -> Iterator[tuple[str, rr.AsComponents]]:
        """What never changes: names below the world's entity, and data; ``colour`` of the agent."""
        yield "", rr.ViewCoordinates.FRD
        yield "flights", rr.LineStrips3D.from_fields(radii=[THICK])
        count = len(self.corners)
        yield (
            "mesh",
            rr.Mesh3D(
                vertex_positions=self.corners.reshape(-1, 3),
                triangle_indices=np.arange(3 * count).reshape(-1, 3),
                vertex_colors=np.repeat(self.paint, 3, axis=0),
            ),
        )
        yield "drone", rr.Arrows3D.from_fields(colors=[colour], radii=[1.5 * THICK])

    def view(self, name: str, origin: str) -> rrb.View:
        """All of it, from above and a little from the south."""
        low, high = self.corners.min((0, 1)), self.corners.max((0, 1))
        middle, span = (low + high) / 2, high - low
        # Wide worlds are seen along their shorter side, so that they fill the view.
        east_up = span[0] > span[1]
        far = 0.6 * float(max(span[0], span[1])) + 5.0
        away = np.array([0.0, -0.25, -1.0] if east_up else [-0.25, 0.0, -1.0]) * far
        eye = rrb.EyeControls3D(
            position=middle + away,
            look_target=middle,
            eye_up=[0.0, 1.0, 0.0] if east_up else [1.0, 0.0, 0.0],
        )
        return rrb.Spatial3DView(name=name, origin=origin, eye_controls=eye, line_grid=False)


def face_colours(mesh: Mesh) -> NDArray[np.uint8]:
    """(T, 3) mean colour of every triangle, shaded by where it faces: there is no lamp."""
    edges = mesh.corner[:, 1:] - mesh.corner[:, :1]
    normal = np.cross(edges[:, 0], edges[:, 1]).astype(np.float64)
    normal = np.abs(normal) / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return np.asarray(255 * albedo_of(mesh) ** (1 / GAMMA) * (normal @ SHADE)[:, None], np.uint8)
