"""One drone's flight in Rerun: its world, where it is, what it sees, how it fares.

Interface: :class:`FlightFilm`.

=======================  ==========================================================
``world``                the scene without its ceiling, NED
``world/drone``          the pose that telemetry reports, ``eye`` its camera
``world/trail``          where it has been, the last :data:`TRAIL` steps
``reward``, ``speed``,   of each step; speed [m/s], height above home [m], battery
``height``, ``battery``  [%]
``log``                  what happened
=======================  ==========================================================

Timeline: ``time``, wall clock.
"""

import time
from pathlib import Path
from typing import Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from agent.vehicle import Vehicle
from deploy.viewer import colours
from deploy.viewer.meshes import OpenMesh
from sim.indoor.content.scene import Scene
from sim.indoor.flight.env import IndoorFlight

TRAIL = 500  # steps; 200 m
QUALITY = 85  # of the pictures; JPEG, a tenth of their size
LEAVES = 20.0  # s for what was recorded to reach the disk
PLOTS = ("reward", "speed", "height", "battery")
DRONE = colours.FIRST[1]
RADIUS = 0.25  # m, of the sphere that is the drone


class FlightFilm:
    """Writes a flight to a file while it is flown."""

    def __init__(self, path: Path, scene: Scene) -> None:
        self._stream = rr.RecordingStream("swarm flight")
        self._stream.save(path, default_blueprint=_blueprint())
        self._trail: list[NDArray[np.float64]] = []
        self._log("world", rr.ViewCoordinates.FRD, static=True)
        self._log("world/room", OpenMesh.of(scene.mesh).drawn(), static=True)
        self._log("world/drone/body", rr.Points3D([[0, 0, 0]], radii=[RADIUS], colors=[DRONE]),
                  static=True)  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._stream.flush(timeout_sec=LEAVES)
        self._stream.disconnect()

    def take(self, drone: Vehicle, world: IndoorFlight, reward: float) -> None:
        """One step: pose and picture of the environment, the rest from telemetry."""
        self._stream.set_time("time", timestamp=time.time())
        pose, picture, state = world.pose, world.picture, drone.state
        turn = rr.Quaternion(xyzw=turned(*pose[3:]))
        self._log("world/drone", rr.Transform3D(translation=pose[:3], quaternion=turn))
        across, down = world.camera.tangents
        eye = rr.Pinhole(
            image_from_camera=_projection(world.camera.width, world.camera.height, across, down),
            resolution=[world.camera.width, world.camera.height],
            camera_xyz=rr.ViewCoordinates.FRD,
            image_plane_distance=0.5,
        )
        self._log("world/drone/eye", eye)
        self._log("world/drone/eye", rr.Image(picture).compress(jpeg_quality=QUALITY))
        self._trail = [*self._trail[1 - TRAIL :], pose[:3]]
        self._log("world/trail", rr.LineStrips3D([self._trail], colors=[DRONE], radii=[0.03]))
        self._log("reward", rr.Scalars(reward))
        self._log("speed", rr.Scalars(float(np.linalg.norm(state.velocity))))
        self._log("height", rr.Scalars(-state.position[2]))
        if state.battery is not None:
            self._log("battery", rr.Scalars(100 * state.battery))

    def say(self, text: str) -> None:
        """One line of the log."""
        self._stream.set_time("time", timestamp=time.time())
        self._log("log", rr.TextLog(text))

    def _log(self, path: str, what: rr.AsComponents, *, static: bool = False) -> None:
        self._stream.log(path, what, static=static)


def turned(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """World from body as Rerun wants it: x, y, z, w."""
    (sr, sp, sy), (cr, cp, cy) = (
        np.sin([roll / 2, pitch / 2, yaw / 2]),
        np.cos([roll / 2, pitch / 2, yaw / 2]),
    )
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


def _projection(width: int, height: int, across: float, down: float) -> NDArray[np.float64]:
    """(3, 3) of a pinhole that is `across` and `down` wide to each side, a metre ahead."""
    return np.array(
        [
            [width / (2 * across), 0.0, width / 2],
            [0.0, height / (2 * down), height / 2],
            [0.0, 0.0, 1.0],
        ]
    )


def _blueprint() -> rrb.Blueprint:
    plots = [rrb.TimeSeriesView(name=name.capitalize(), origin=name) for name in PLOTS]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(name="World", origin="world"),
            rrb.Vertical(
                rrb.Spatial2DView(name="Camera", origin="world/drone/eye"),
                *plots,
                rrb.TextLogView(name="Log", origin="log"),
                row_shares=[3, 1, 1, 1, 1, 1],
            ),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="following"),
        collapse_panels=True,
    )
