"""Furniture, modelled around the origin with its front to the north, standing on z = 0.

Every function returns faces; ``Plan.put`` turns and places them.  Sizes are in metres.
"""

import numpy as np

from sim.indoor.content.patterns import artwork, books, leaves
from sim.indoor.content.textures import Material, plain, wood
from sim.indoor.geometry.shapes import Face, Point, ball, box, circle, face, fitted, move, prism

METAL = plain("#6b7076")
BLACK = plain("#1b1c1f")
OAK = wood("#a8794a", seed=3)
WALNUT = wood("#5b3a24", seed=5)


def table(
    width: float = 1.4, depth: float = 0.8, height: float = 0.75, material: Material = OAK
) -> list[Face]:
    x, y = width / 2, depth / 2
    faces = box((-x, x), (-y, y), (height - 0.05, height), material)
    for sx in (-1, 1):
        for sy in (-1, 1):
            cx, cy = sx * (x - 0.06), sy * (y - 0.06)
            faces += box(
                (cx - 0.03, cx + 0.03), (cy - 0.03, cy + 0.03), (0, height - 0.05), material
            )
    return faces


def chair(material: Material = OAK, seat: Material | None = None) -> list[Face]:
    faces = move(table(0.44, 0.44, 0.46, material), (0, 0))
    if seat is not None:
        faces += box((-0.21, 0.21), (-0.21, 0.21), (0.46, 0.51), seat)
    for x in (-0.19, 0.19):
        faces += box((x - 0.025, x + 0.025), (-0.22, -0.18), (0.46, 0.95), material)
    faces += box((-0.19, 0.19), (-0.215, -0.185), (0.62, 0.92), material)
    return faces


def sofa(cloth: Material, width: float = 2.0, cushion: Material | None = None) -> list[Face]:
    x = width / 2
    faces = box((-x, x), (-0.45, 0.45), (0.05, 0.30), cloth)
    faces += box((-x, x), (-0.45, -0.22), (0.30, 0.85), cloth)
    for side in (-1, 1):
        a, b = sorted((side * x, side * (x - 0.2)))
        faces += box((a, b), (-0.22, 0.45), (0.30, 0.62), cloth)
    seats = max(1, round((width - 0.4) / 0.8))
    wide = (width - 0.4) / seats
    for k in range(seats):
        left = -x + 0.2 + k * wide
        faces += box((left + 0.01, left + wide - 0.01), (-0.21, 0.43), (0.30, 0.46), cloth)
    if cushion is not None:
        for side in (-1, 1):
            pillow = box((-0.2, 0.2), (-0.07, 0.07), (0.0, 0.36), cushion)
            faces += move(pillow, (side * (x - 0.5), -0.1), heading=side * 14, lift=0.46)
    return faces


def shelf(
    width: float = 1.0,
    height: float = 2.0,
    depth: float = 0.32,
    rows: int = 5,
    material: Material = WALNUT,
    filled: bool = True,
    seed: int = 0,
) -> list[Face]:
    """A book case with its back to the south."""
    x, y = width / 2, depth / 2
    faces = box((-x, x), (-y, -y + 0.02), (0, height), material)
    for side in (-1, 1):
        a, b = sorted((side * x, side * (x - 0.03)))
        faces += box((a, b), (-y + 0.02, y), (0, height), material)
    gap = (height - 0.03) / rows
    for k in range(rows + 1):
        z = min(k * gap, height - 0.03)
        faces += box((-x + 0.03, x - 0.03), (-y + 0.02, y), (z + 0.001, z + 0.03), material)
        if filled and k < rows:
            rng = np.random.default_rng((seed, k))
            start = -x + 0.03 + float(rng.uniform(0, 0.25)) * width
            stop = x - 0.03 - float(rng.uniform(0, 0.25)) * width
            row = box((start, stop), (-y + 0.02, y - 0.05), (z + 0.03, z + gap * 0.85), books(seed))
            faces += row[:5]
    return faces


def cabinet(
    material: Material, width: float = 1.2, height: float = 0.9, depth: float = 0.45, doors: int = 2
) -> list[Face]:
    x, y = width / 2, depth / 2
    faces = box((-x, x), (-y, y), (0.06, height), material)
    faces += box((-x + 0.03, x - 0.03), (-y, y - 0.05), (0, 0.06), BLACK)
    wide = width / doors
    for k in range(doors):
        left = -x + k * wide
        faces += box(
            (left + 0.02, left + wide - 0.02), (y, y + 0.02), (0.10, height - 0.04), material
        )
        knob = left + wide * (0.85 if k % 2 == 0 else 0.15)
        faces += box((knob - 0.02, knob + 0.02), (y + 0.02, y + 0.04), (0.5, 0.56), METAL)
    return faces


def plant(height: float = 1.3, pot: Material | None = None, seed: int = 0) -> list[Face]:
    """A pot and a crown of leaves: crossing, leaning diamonds seen from both sides."""
    faces = prism(
        circle((0, 0), 0.16, 10), 0, 0.34, pot or plain("#b5653c"), plain("#2b1c12"), taper=1.3
    )
    rng = np.random.default_rng(seed)
    green = leaves("#3f8a35", seed)
    for k in range(11):
        turn = k * 137.5
        reach, top = rng.uniform(0.25, 0.5), height * rng.uniform(0.65, 1.0)
        tip, middle = np.array([0.0, reach, top]), np.array([0.0, reach * 0.45, top * 0.72])
        wide = np.array([0.09, 0.0, 0.0])
        root = np.array([0.0, 0.0, 0.32])
        leaf = [
            (root, middle + wide, tip),
            (root, tip, middle - wide),
        ]
        for corners in leaf:
            faces += move([face(corners, green), face(corners[::-1], green)], (0, 0), turn)
    return faces


def floor_lamp(shade: str = "#ffe2a8", height: float = 1.7) -> list[Face]:
    faces = prism(circle((0, 0), 0.15, 10), 0, 0.03, BLACK, BLACK)
    faces += prism(circle((0, 0), 0.015, 5), 0.03, height - 0.3, METAL)
    faces += prism(
        circle((0, 0), 0.22, 12),
        height - 0.35,
        height,
        plain(shade, glow=0.9),
        plain(shade, glow=1.0),
        plain(shade, glow=1.0),
        taper=0.6,
    )
    return faces


def wastebasket(material: Material = BLACK) -> list[Face]:
    return prism(circle((0, 0), 0.17, 12), 0, 0.55, material, BLACK, taper=1.15)


def barrel(material: Material) -> list[Face]:
    faces = prism(circle((0, 0), 0.27, 14), 0, 0.44, material, taper=1.12)
    return faces + prism(
        circle((0, 0), 0.27 * 1.12, 14), 0.44, 0.88, material, material, taper=0.89
    )


def crate(material: Material, size: float = 0.6) -> list[Face]:
    h = size / 2
    return [fitted(f) for f in box((-h, h), (-h, h), (0, size), material)]


def bench(material: Material = OAK, width: float = 1.6) -> list[Face]:
    x = width / 2
    faces = box((-x, x), (-0.2, 0.2), (0.42, 0.47), material)
    for side in (-1, 1):
        a, b = sorted((side * (x - 0.15), side * (x - 0.25)))
        faces += box((a, b), (-0.18, 0.18), (0, 0.42), METAL)
    return faces


def desk(screen: Material, material: Material = OAK) -> list[Face]:
    """A desk with a monitor that faces north, and a chair before it."""
    faces = table(1.5, 0.75, 0.74, material)
    faces += box((-0.12, 0.12), (-0.2, -0.08), (0.741, 0.76), BLACK)
    faces += box((-0.02, 0.02), (-0.16, -0.13), (0.76, 0.95), BLACK)
    faces += box((-0.33, 0.33), (-0.15, -0.11), (0.88, 1.28), BLACK)
    faces += panel(screen, 0.62, 0.36, 1.08, -0.109)
    return faces + move(chair(METAL, BLACK), (0.1, 0.75), heading=180)


def panel(material: Material, width: float, height: float, middle: float, y: float) -> list[Face]:
    """An upright picture that faces north, stretched over its frame."""
    front = box((-width / 2, width / 2), (y - 0.03, y), (middle - height / 2, middle + height / 2),
                material)  # fmt: skip
    return [fitted(front[2])]


def picture(art: Material | None = None, width: float = 1.2, height: float = 0.9,
            middle: float = 1.6, frame: Material = WALNUT) -> list[Face]:  # fmt: skip
    """A framed painting; hang it with its back (south) to a wall."""
    art = art or artwork("#204060", "#e04030", "#f0c040", "#40a0a0")
    x, z = width / 2, height / 2
    border = box((-x - 0.06, x + 0.06), (0.0, 0.04), (middle - z - 0.06, middle + z + 0.06), frame)
    return border + panel(art, width, height, middle, 0.045)


def door(material: Material, width: float = 0.95, height: float = 2.1) -> list[Face]:
    """A closed door in its frame; its back (south) stands against a wall."""
    x = width / 2
    faces = box((-x, x), (0, 0.04), (0, height), material)
    for side in (-1, 1):
        a, b = sorted((side * x, side * (x + 0.09)))
        faces += box((a, b), (0, 0.07), (0, height + 0.09), WALNUT)
    faces += box((-x, x), (0, 0.07), (height, height + 0.09), WALNUT)
    return faces + box((x - 0.14, x - 0.06), (0.04, 0.09), (1.0, 1.04), METAL)


def bicycle(frame: Material | None = None) -> list[Face]:
    """Seen from the side along x: two wheels of thin rims, a frame, a handlebar."""
    paint = frame or plain("#b02a2a")
    faces: list[Face] = []
    for x in (-0.52, 0.52):
        for k in range(14):
            a, b = 2 * np.pi * k / 14, 2 * np.pi * (k + 1) / 14
            faces += bar((x + 0.33 * np.cos(a), 0.33 + 0.33 * np.sin(a)),
                         (x + 0.33 * np.cos(b), 0.33 + 0.33 * np.sin(b)), 0.02, BLACK)  # fmt: skip
        for k in range(4):
            a = np.pi * k / 4
            dx, dz = 0.32 * np.cos(a), 0.32 * np.sin(a)
            faces += bar((x - dx, 0.33 - dz), (x + dx, 0.33 + dz), 0.005, METAL)
    joints = [
        ((-0.52, 0.33), (-0.2, 0.85)),
        ((-0.2, 0.85), (0.38, 0.85)),
        ((0.38, 0.85), (0, 0.35)),
        ((0, 0.35), (-0.52, 0.33)),
        ((-0.2, 0.8), (0, 0.35)),
        ((0.36, 0.98), (0.52, 0.33)),
    ]
    for a2, b2 in joints:  # fmt: skip
        faces += bar(a2, b2, 0.025, paint)
    faces += box((-0.32, -0.1), (-0.06, 0.06), (0.88, 0.94), BLACK)
    return faces + box((0.33, 0.37), (-0.25, 0.25), (0.98, 1.02), BLACK)


def bar(start: Point, stop: Point, width: float, material: Material) -> list[Face]:
    """A square rod in the plane y = 0 between two points (x, z)."""
    (ax, az), (bx, bz) = start, stop
    length = float(np.hypot(bx - ax, bz - az))
    tilt = np.arctan2(bz - az, bx - ax)
    rod = box((0.001, length), (-width / 2, width / 2), (-width / 2, width / 2), material)
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    shift = np.array([ax, 0.0, az])
    return [
        Face(f.points @ turn.T + shift, f.material, turn @ f.along, turn @ f.down,
             turn @ f.origin + shift) for f in rod
    ]  # fmt: skip


def pillar(material: Material, radius: float, height: float, corners: int = 20) -> list[Face]:
    return prism(circle((0, 0), radius, corners), 0, height, material)


def globe(material: Material, radius: float = 0.2) -> list[Face]:
    """A ball on the floor."""
    return ball((0.0, 0.0, radius), radius, material)


def rack(material: Material, light: Material, height: float = 2.0) -> list[Face]:
    """A server cabinet with a lit front."""
    faces = box((-0.35, 0.35), (-0.45, 0.45), (0, height), material)
    return faces + panel(light, 0.6, height - 0.2, height / 2, 0.455)


def bed(cloth: Material, frame: Material = WALNUT) -> list[Face]:
    faces = box((-0.8, 0.8), (-1.0, 1.0), (0.1, 0.32), frame)
    faces += box((-0.76, 0.76), (-0.96, 0.96), (0.32, 0.52), cloth)
    faces += box((-0.8, 0.8), (-1.06, -1.0), (0, 1.0), frame)
    for x in (-0.38, 0.38):
        faces += box((x - 0.3, x + 0.3), (-0.9, -0.5), (0.52, 0.64), plain("#f2efe8"))
    return faces


def stairs(material: Material, steps: int = 6, width: float = 1.2) -> list[Face]:
    """Solid steps that rise to the south, against a wall."""
    faces: list[Face] = []
    for k in range(steps):
        y = -0.28 * k
        faces += box((-width / 2, width / 2), (y - 0.28, y), (0, 0.17 * (k + 1)), material)
    return faces
