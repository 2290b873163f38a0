"""An indoor scene as a vehicle feels it: walls to bump into, floors and tables to stand on.

Interface: :class:`Room`, a ``quadrotor.World``.  The vehicle's local frame has its origin at home,
on the floor below one of the scene's start poses, as an autopilot's has where it was switched on.
Its axes are those of the scene.  Who flies there adds :attr:`Room.home` to what telemetry says.
"""

import math

import numpy as np

from sim.indoor.content.scene import load
from sim.indoor.flight.body import Pose, home_of
from sim.indoor.geometry.collision import sweep
from sim.indoor.render.rays import cast
from sim.vehicle.frames import Doubles


class Room:
    """The collision mesh of a scene around a vehicle's home.

    Args:
        scene: name or file of the world.
        start: above which of its start poses home is.

    Raises:
        ValueError: there is no such world or start.
    """

    def __init__(self, scene: str, start: int = 0) -> None:
        world = load(scene, lit=False)
        self.home: Pose = home_of(world, start)
        self._offset = np.array(self.home[:3])
        mesh = world.mesh
        self._tree = mesh.corner, mesh.box, mesh.link, mesh.root[0]

    def reach(self, start: Doubles, move: Doubles, radius: float) -> float:
        """See ``quadrotor.World``."""
        return float(sweep(*self._tree, start + self._offset, move, radius))

    def floor(self, place: Doubles) -> float:
        """z of what is straight below [m, local NED]; the floor of home where nothing is."""
        x, y, z = place + self._offset
        below, _ = cast(*self._tree, x, y, z, 0.0, 0.0, 1.0, np.inf, False)
        return float(place[2] + below) if math.isfinite(below) else 0.0
