"""A world as a floor plan: one outline, islands in it, walls with openings, furniture and lamps.

Coordinates: x to the right (east), y up the page (north), metres; headings are compass degrees,
0 up the page, 90 to the right.  Walls run from the floor to the ceiling.  A scene's page reads like
this::

    plan = Plan(height=3.2, exposure=1.3)
    plan.room([(0, 0), (30, 0), (30, 20), (0, 20)], floor=wood, ceiling=white, walls=brick)
    plan.island([(8, 6), (22, 6), (22, 14), (8, 14)], walls=stone)
    plan.wall((0, 10), (8, 10), brick, openings=[Opening(3, 2.4)])
    plan.put(sofa(red), (4, 1.0), heading=0)
    plan.lamp(4, 3)
    plan.start(4, 10, heading=0)
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sim.indoor.content.textures import Material, colour, plain
from sim.indoor.geometry.shapes import Face, Point, box, circle, face, move, prism

CRUISE = 1.5  # m above the floor; where flights start
SLAB = 0.006  # m; how thick a carpet is
CUT = plain("#2a2c30", glow=1.0)  # solid matter, where a plan cuts through it


class Opening(NamedTuple):
    """A doorway, or with a sill a window; `at` is its middle, from the wall's start [m]."""

    at: float
    width: float
    sill: float = 0.0
    top: float = 2.4


class Start(NamedTuple):
    """Where a flight may begin: x east, y north, height [m], heading [compass degrees]."""

    x: float
    y: float
    height: float
    heading: float


class Lamp(NamedTuple):
    x: float
    y: float
    height: float
    colour: str
    power: float


@dataclass
class Plan:
    """Everything that a scene's page says."""

    height: float = 3.2  # m, floor to ceiling
    exposure: float = 1.2  # of the picture; brighter above 1
    faces: list[Face] = field(default_factory=list)
    lamps: list[Lamp] = field(default_factory=list)
    starts: list[Start] = field(default_factory=list)
    views: list[Start] = field(default_factory=list)

    def room(
        self,
        outline: Sequence[Point],
        *,
        floor: Material,
        ceiling: Material,
        walls: Material | Sequence[Material],
    ) -> None:
        """The shell, seen from inside: outline counter-clockwise, one material for each side."""
        points = [(float(x), float(y)) for x, y in outline]
        sides = [walls] * len(points) if isinstance(walls, Material) else list(walls)
        sides = [sides[k % len(sides)] for k in range(len(points))]
        self.faces.append(face([(x, y, 0.0) for x, y in points], floor))
        self.faces.append(face([(x, y, self.height) for x, y in points[::-1]], ceiling))
        self.faces += prism(points[::-1], 0.0, self.height, [*sides[-2::-1], sides[-1]])

    def island(self, outline: Sequence[Point], *, walls: Material | Sequence[Material]) -> None:
        """A block from floor to ceiling, seen from outside: outline counter-clockwise.

        Its lid is above the ceiling and shows only on pictures from above.
        """
        self.faces += prism(outline, 0.0, self.height, walls, top=CUT)

    def wall(
        self,
        start: Point,
        stop: Point,
        material: Material,
        *,
        thickness: float = 0.2,
        openings: Sequence[Opening] = (),
    ) -> None:
        """A straight wall with doorways and windows."""
        length = float(np.hypot(stop[0] - start[0], stop[1] - start[1]))
        heading = float(np.degrees(np.arctan2(stop[0] - start[0], stop[1] - start[1])))
        half = thickness / 2
        parts: list[Face] = []
        at = 0.0
        for hole in sorted(openings):
            low, high = hole.at - hole.width / 2, hole.at + hole.width / 2
            if low > at:
                parts += box((-half, half), (at, low), (0, self.height), material)
            if hole.sill > 0:
                parts += box((-half, half), (low, high), (0, hole.sill), material)
            if hole.top < self.height:
                parts += box((-half, half), (low, high), (hole.top, self.height), material)
            at = high
        if at < length:
            parts += box((-half, half), (at, length), (0, self.height), material)
        self.faces += move(parts, start, heading)

    def carpet(self, outline: Sequence[Point], material: Material) -> None:
        """Another floor on a part of the floor."""
        self.faces += prism(outline, 0.0, SLAB, material, material)

    def canopy(self, outline: Sequence[Point], material: Material, drop: float) -> None:
        """A lower ceiling over a part of the plan."""
        self.faces += prism(outline, self.height - drop, self.height, material, bottom=material)

    def put(self, thing: list[Face], at: Point, heading: float = 0.0, lift: float = 0.0) -> None:
        """A piece of furniture; its front looks towards `heading`."""
        self.faces += move(thing, at, heading, lift)

    def lamp(
        self, x: float, y: float, tone: str = "#fff1dc", power: float = 3.0, drop: float = 0.25
    ) -> None:
        """A lamp under the ceiling: a bright disc, and its light from a little below."""
        disc = circle((0, 0), 0.28, 12)
        fitting = prism(disc, self.height - 0.05, self.height, plain(tone, glow=1.0),
                        bottom=plain(tone, glow=1.0))  # fmt: skip
        self.faces += move(fitting, (x, y))
        self.lamps.append(Lamp(x, y, self.height - drop, tone, power))

    def glow(self, x: float, y: float, height: float, tone: str, power: float) -> None:
        """Light without a fitting: from a floor lamp, a screen, a neon sign."""
        self.lamps.append(Lamp(x, y, height, tone, power))

    def start(self, x: float, y: float, heading: float, height: float = CRUISE) -> None:
        """A place where flights begin."""
        self.starts.append(Start(x, y, height, heading))

    def view(self, x: float, y: float, heading: float, height: float = 1.6) -> None:
        """A place to take a picture for the contact sheet."""
        self.views.append(Start(x, y, height, heading))


def linear(tone: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """A colour in linear light."""
    return np.asarray(colour(tone) ** 2.2)
