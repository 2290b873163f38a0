"""Solids made of flat faces: prisms, boxes, balls, and how a face is cut into triangles.

Coordinates are those of a floor plan: x to the right (east), y up the page (north), z up [m];
``assembly.py`` turns them into NED.  Faces are wound counter-clockwise for who sees
them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from sim.indoor.content.textures import Material
from sim.indoor.geometry.mesh import Doubles

Point = tuple[float, float]
Points = npt.NDArray[np.float64]  # (n, 3)


@dataclass(frozen=True)
class Face:
    """A flat polygon; its picture's columns run along `along` from `origin`, its rows along `down`.

    With `fit` the picture is stretched over the face once instead of being repeated.
    """

    points: Points
    material: Material
    along: Doubles
    down: Doubles
    origin: Doubles
    fit: bool = False

    @property
    def normal(self) -> Doubles:
        """Unit normal (Newell's sum, so that concave polygons are right too)."""
        following = np.roll(self.points, -1, axis=0)
        total = np.cross(self.points, following).sum(axis=0)
        return np.asarray(total / np.linalg.norm(total))


def face(
    points: Iterable[Sequence[float] | Doubles], material: Material, shift: float = 0.0
) -> Face:
    """A face whose picture stands upright; `shift` [m] moves it sideways."""
    corners = np.array([list(point) for point in points], np.float64)
    following = np.roll(corners, -1, axis=0)
    normal = np.cross(corners, following).sum(axis=0)
    normal /= np.linalg.norm(normal)
    if abs(normal[2]) > 0.7:  # floors and ceilings: aligned to the plan
        along = np.array([1.0, 0.0, 0.0]) - normal * normal[0]
        along /= np.linalg.norm(along)
        return Face(corners, material, along, np.cross(along, normal), np.zeros(3))
    along = np.cross([0.0, 0.0, 1.0], normal)
    along /= np.linalg.norm(along)
    down = np.cross(along, normal)
    down = down if down[2] < 0 else -down
    origin = corners[0] * np.array([1.0, 1.0, 0.0]) - along * shift
    return Face(corners, material, along, down, origin)


def prism(
    outline: Sequence[Point],
    low: float,
    high: float,
    side: Material | Sequence[Material],
    top: Material | None = None,
    bottom: Material | None = None,
    taper: float = 1.0,
) -> list[Face]:
    """A polygon (counter-clockwise) drawn up from `low` to `high`; closed where lids are given.

    `taper` shrinks the upper outline around its centre.
    """
    base = np.array(outline, np.float64)
    roof = base.mean(axis=0) + (base - base.mean(axis=0)) * taper
    sides = [side] * len(base) if isinstance(side, Material) else list(side)
    faces, shift = [], 0.0
    for i, material in enumerate(sides[k % len(sides)] for k in range(len(base))):
        j = (i + 1) % len(base)
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = base[i], base[j], roof[j], roof[i]
        faces.append(
            face([(ax, ay, low), (bx, by, low), (cx, cy, high), (dx, dy, high)], material, shift)
        )
        shift += float(np.hypot(bx - ax, by - ay))
    if top is not None:
        faces.append(face([(x, y, high) for x, y in roof], top))
    if bottom is not None:
        faces.append(face([(x, y, low) for x, y in base[::-1]], bottom))
    return faces


def box(
    x: tuple[float, float],
    y: tuple[float, float],
    z: tuple[float, float],
    material: Material,
    top: Material | None = None,
) -> list[Face]:
    """A box; one that stands on the floor has no bottom."""
    outline = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
    bottom = material if z[0] > 0.001 else None
    return prism(outline, z[0], z[1], material, top or material, bottom)


def circle(centre: Point, radius: float, corners: int = 16, turn: float = 0.0) -> list[Point]:
    """A regular polygon, counter-clockwise."""
    angle = np.arange(corners) * (2 * np.pi / corners) + np.radians(turn)
    return [
        (float(centre[0] + radius * np.cos(a)), float(centre[1] + radius * np.sin(a)))
        for a in angle
    ]


def arc(centre: Point, radius: float, start: float, stop: float, corners: int) -> list[Point]:
    """Points on a circle from angle `start` to `stop` [degrees, counter-clockwise from east]."""
    angle = np.radians(np.linspace(start, stop, corners))
    return [
        (float(centre[0] + radius * np.cos(a)), float(centre[1] + radius * np.sin(a)))
        for a in angle
    ]


def ball(centre: tuple[float, float, float], radius: float, material: Material) -> list[Face]:
    """A sphere of 48 faces."""
    rings = [(-90, 0.0), (-45, 0.707), (0, 1.0), (45, 0.707), (90, 0.0)]
    faces = []
    for (low, inner), (high, outer) in pairwise(rings):
        z0, z1 = centre[2] + radius * np.sin(np.radians([low, high]))
        a = circle(centre[:2], radius * inner, 12)
        b = circle(centre[:2], radius * outer, 12)
        for i in range(12):
            j = (i + 1) % 12
            corners = [(*a[i], z0), (*a[j], z0), (*b[j], z1), (*b[i], z1)]
            if inner == 0.0:
                corners = corners[1:] if a[i] == a[j] else corners
            if outer == 0.0:
                corners = corners[:3]
            faces.append(face(corners, material))
    return faces


def fitted(panel: Face) -> Face:
    """The same face with its picture stretched over it once."""
    return Face(panel.points, panel.material, panel.along, panel.down, panel.origin, fit=True)


def move(faces: list[Face], at: Point, heading: float = 0.0, lift: float = 0.0) -> list[Face]:
    """Faces modelled around the origin, facing north: turned to `heading` (compass) and placed."""
    c, s = np.cos(np.radians(heading)), np.sin(np.radians(heading))
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # clockwise seen from above
    shift = np.array([at[0], at[1], lift])
    return [
        Face(
            f.points @ turn.T + shift,
            f.material,
            turn @ f.along,
            turn @ f.down,
            turn @ f.origin + shift,
            f.fit,
        )
        for f in faces
    ]


def triangulate(points: Points, normal: Doubles) -> list[tuple[int, int, int]]:
    """Ear clipping of a simple polygon, wound as the normal says."""
    if len(points) <= 4:
        return [(0, k, k + 1) for k in range(1, len(points) - 1)]
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(points, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat[:, ::-1]

    def cross(o: int, a: int, b: int) -> float:
        return float(
            (flat[a, 0] - flat[o, 0]) * (flat[b, 1] - flat[o, 1])
            - (flat[a, 1] - flat[o, 1]) * (flat[b, 0] - flat[o, 0])
        )

    left = list(range(len(points)))
    ears = []
    while len(left) > 3:
        best, chosen = -1.0, -1
        for k in range(len(left)):
            o, a, b = left[k - 1], left[k], left[(k + 1) % len(left)]
            area = cross(o, a, b)
            if area <= 1e-12:
                continue
            if any(
                cross(o, a, p) >= -1e-12 and cross(a, b, p) >= -1e-12 and cross(b, o, p) >= -1e-12
                for p in left
                if p not in {o, a, b}
            ):
                continue
            sides = [np.linalg.norm(flat[i] - flat[j]) for i, j in ((o, a), (a, b), (b, o))]
            shape = area / max(float(max(sides)) ** 2, 1e-12)  # fat triangles first
            if shape > best:
                best, chosen = shape, k
            if shape > 0.3:  # good enough
                break
        if chosen < 0:
            raise ValueError("the outline of a face crosses itself")
        ears.append((left[chosen - 1], left[chosen], left[(chosen + 1) % len(left)]))
        del left[chosen]
    ears.append((left[0], left[1], left[2]))
    return ears
