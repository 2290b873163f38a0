"""Indoor worlds as the viewer draws them: the mesh without its ceiling, seen from above.

Frame: NED metres, as the worlds are; Rerun is told that z points down.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from deploy.viewer import colours
from deploy.viewer.meshes import OpenMesh
from sim.indoor.content.scene import Scene

THICK = 0.2  # [m] radius of paths


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """An indoor world, without its ceiling."""

    mesh: OpenMesh

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """The picture of a world."""
        return cls(OpenMesh.of(scene.mesh))

    def still(self) -> Iterator[tuple[str, rr.AsComponents]]:
        """What never changes: names below the world's entity, and data."""
        yield "", rr.ViewCoordinates.FRD
        yield "mesh", self.mesh.drawn()

    def moving(self, colour: colours.Colour) -> Iterator[tuple[str, rr.AsComponents]]:
        """How an agent of this ``colour`` is drawn in it, likewise."""
        yield "flights", rr.LineStrips3D.from_fields(radii=[THICK])
        yield "drone", rr.Arrows3D.from_fields(colors=[colour], radii=[1.5 * THICK])

    def view(self, name: str, origin: str, contents: list[str]) -> rrb.View:
        """All of it, from above and a little from the south."""
        low, high = self.mesh.corners.min((0, 1)), self.mesh.corners.max((0, 1))
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
        return rrb.Spatial3DView(
            name=name, origin=origin, contents=contents, eye_controls=eye, line_grid=False
        )
