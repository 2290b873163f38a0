"""The drone's camera: an ideal pinhole that returns colour and metric depth.

Convention.  The camera sits at the body's position and looks along its nose; a level body has a
level camera.  Body axes are x forward, y right, z down (FRD), the world is NED.  Pixel (row i,
column j) of an H x W picture looks along

    forward + tan(hfov / 2) * (2 (j + 1/2) / W - 1) * right
            + tan(hfov / 2) / aspect * (2 (i + 1/2) / H - 1) * down

so the picture spans `hfov` horizontally and 2 atan(tan(hfov / 2) / aspect) vertically, whatever its
number of pixels.  PEDRA's picture of 320 x 180 with 80 degrees (50.5 vertically) is seen through
103 x 103 pixels that are wider than high.

Depth is the distance along the optical axis (AirSim calls it planar), not along the ray; it is
`inf` where nothing is.

No number crashes a kernel: from a pose that is not finite, or farther than `FAR` from the origin,
nothing is seen.  Who asks for such a pose is told so where it enters (`sim.indoor.errors.checked`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim.indoor.compiled import compiled
from sim.indoor.errors import FAR, checked_pose
from sim.indoor.geometry.mesh import Doubles, Floats, Mesh
from sim.indoor.render.raster import Canvas, canvas, see
from sim.indoor.render.shade import Picture, shade


@dataclass(frozen=True)
class Camera:
    """Size and field of view.  The default is the paper's."""

    height: int = 103  # pixels
    width: int = 103
    hfov: float = float(np.radians(80.0))  # rad
    aspect: float = 320 / 180  # of the scene seen, not of the number of pixels

    def __post_init__(self) -> None:
        for name, pixels in (("height", self.height), ("width", self.width)):
            if not 1 <= pixels <= MOST_PIXELS:
                raise ValueError(f"camera.{name} = {pixels}: expected 1 to {MOST_PIXELS} pixels")
        if not 1e-3 <= self.hfov <= np.pi - 1e-3:
            raise ValueError(f"camera.hfov = {self.hfov}: expected more than 0, less than pi rad")
        if not 1e-2 <= self.aspect <= 1e2:
            raise ValueError(f"camera.aspect = {self.aspect}: expected 0.01 to 100")

    @property
    def tangents(self) -> tuple[float, float]:
        """Half the picture's width and height, one metre ahead [m]."""
        across = float(np.tan(self.hfov / 2))
        return across, across / self.aspect


MOST_PIXELS = 8192  # a side


class View(NamedTuple):
    """RGB (H, W, 3) uint8 and depth (H, W) float32 [m]."""

    rgb: Picture
    depth: Floats


@compiled
def rays(pose: Doubles, height: int, width: int, tangents: tuple[float, float]) -> Doubles:
    """World from pixel: columns are one pixel right, one pixel down, and the ray of pixel (0, 0).

    `pose` is x, y, z [m, NED], roll, pitch, yaw [rad], applied yaw first.
    """
    cr, sr = np.cos(pose[3]), np.sin(pose[3])
    cp, sp = np.cos(pose[4]), np.sin(pose[4])
    cy, sy = np.cos(pose[5]), np.sin(pose[5])
    forward = (cp * cy, cp * sy, -sp)
    right = (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp)
    down = (cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp)
    step_x, step_y = 2.0 * tangents[0] / width, 2.0 * tangents[1] / height
    corner_x, corner_y = step_x * 0.5 - tangents[0], step_y * 0.5 - tangents[1]
    m = np.empty((3, 3), np.float64)
    for axis in range(3):
        m[axis, 0] = right[axis] * step_x
        m[axis, 1] = down[axis] * step_y
        m[axis, 2] = forward[axis] + corner_x * right[axis] + corner_y * down[axis]
    return m


@compiled
def inverse(m: Doubles) -> Doubles:
    """The inverse of a 3 x 3 matrix."""
    out = np.empty((3, 3), np.float64)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            out[j, i] = m[a, c] * m[b, d] - m[a, d] * m[b, c]
    out /= m[0, 0] * out[0, 0] + m[0, 1] * out[1, 0] + m[0, 2] * out[2, 0]
    return out


@compiled
def somewhere(pose: Doubles) -> bool:
    """Whether a pose is finite and within `FAR` of the origin.  False for NaN."""
    inside = True
    for axis in range(3):
        inside &= abs(pose[axis]) <= FAR
    for axis in range(3, 6):
        inside &= abs(pose[axis]) < np.inf
    return inside


@compiled
def look(
    canvas: Canvas,
    mesh: Mesh,
    world: int,
    pose: Doubles,
    tangents: tuple[float, float],
    smooth: bool,
    rgb: Picture,
    depth: Floats,
) -> None:
    """Render the view from `pose` into `rgb` and `depth`."""
    if not somewhere(pose):
        rgb[:] = 0
        depth[:] = np.inf
        return
    world_from_pixel = rays(pose, depth.shape[0], depth.shape[1], tangents)
    pixel_from_world = inverse(world_from_pixel)
    eye = pose[:3]
    slots = see(canvas, mesh, world, pixel_from_world, eye)
    shade(canvas, mesh, slots, world_from_pixel, pixel_from_world, eye, smooth, rgb, depth)


class Renderer:
    """A camera of any size in one world, for pictures rather than for flights."""

    def __init__(self, mesh: Mesh, camera: Camera, *, smooth: bool = True) -> None:
        """With `smooth`, texels that are larger than a pixel are blended."""
        self.mesh, self.camera, self.smooth = mesh, camera, smooth
        self._canvas = canvas(camera.height, camera.width, mesh.triangles)

    def look(self, pose: Sequence[float] | Doubles, world: int = 0) -> View:
        """What is seen from x, y, z [m, NED], roll, pitch, yaw [rad].

        Raises:
            PoseError: the pose is none.
        """
        rgb = np.empty((self.camera.height, self.camera.width, 3), np.uint8)
        depth = np.empty((self.camera.height, self.camera.width), np.float32)
        place = checked_pose(pose, "pose")
        look(self._canvas, self.mesh, world, place, self.camera.tangents, self.smooth, rgb, depth)
        return View(rgb, depth)
