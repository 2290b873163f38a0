"""Straight lines through the world: the nearest surface along a ray.

Interface: ``cast`` for one ray (compiled callers), ``cast_many`` for arrays of them.
Source: Moeller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
"""

import numpy as np

from sim.indoor.compiled import compiled
from sim.indoor.geometry.mesh import Doubles, Floats, Ints, Mesh

EDGE = 1e-7  # how far outside its edges a triangle still counts, in barycentric units


@compiled
def _hit(
    corner: Floats,
    t: int,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
) -> float:
    """Distance along the ray to triangle `t`, inf if it is missed."""
    ax, ay, az = float(corner[t, 0, 0]), float(corner[t, 0, 1]), float(corner[t, 0, 2])
    ux, uy, uz = corner[t, 1, 0] - ax, corner[t, 1, 1] - ay, corner[t, 1, 2] - az
    vx, vy, vz = corner[t, 2, 0] - ax, corner[t, 2, 1] - ay, corner[t, 2, 2] - az
    px, py, pz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
    det = ux * px + uy * py + uz * pz
    if abs(det) < 1e-14:
        return np.inf
    scale = 1.0 / det
    sx, sy, sz = ox - ax, oy - ay, oz - az
    u = (sx * px + sy * py + sz * pz) * scale
    if u < -EDGE or u > 1.0 + EDGE:
        return np.inf
    qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
    v = (dx * qx + dy * qy + dz * qz) * scale
    if v < -EDGE or u + v > 1.0 + EDGE:
        return np.inf
    distance = (vx * qx + vy * qy + vz * qz) * scale
    return distance if distance > 0.0 else np.inf


@compiled
def _enter(
    box: Floats,
    n: int,
    ox: float,
    oy: float,
    oz: float,
    ix: float,
    iy: float,
    iz: float,
    limit: float,
) -> float:
    """Distance at which the ray enters a node's box, inf if it misses it within `limit`."""
    a, b = (box[n, 0] - ox) * ix, (box[n, 3] - ox) * ix
    enter, leave = min(a, b), max(a, b)
    a, b = (box[n, 1] - oy) * iy, (box[n, 4] - oy) * iy
    enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    a, b = (box[n, 2] - oz) * iz, (box[n, 5] - oz) * iz
    enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    # a little slack: boxes of flat walls are flat
    return enter if enter <= leave * 1.0000004 + 1e-9 and leave >= 0.0 and enter < limit else np.inf


@compiled
def _reciprocal(value: float) -> float:
    return 1.0 / value if abs(value) > 1e-12 else (1e12 if value >= 0.0 else -1e12)


@compiled
def cast(
    corner: Floats,
    box: Floats,
    link: Ints,
    root: int,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    limit: float,
    any_hit: bool,
) -> tuple[float, int]:
    """Distance in units of the direction's length and triangle; inf and -1 where nothing is."""
    ix, iy, iz = _reciprocal(dx), _reciprocal(dy), _reciprocal(dz)
    best, found = limit, -1
    stack = np.empty(128, np.int32)
    stack[0] = root
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if _enter(box, node, ox, oy, oz, ix, iy, iz, best) == np.inf:
            continue
        first, count = link[node, 0], link[node, 1]
        if count > 0:
            for t in range(first, first + count):
                distance = _hit(corner, t, ox, oy, oz, dx, dy, dz)
                if distance < best:
                    best, found = distance, t
                    if any_hit:
                        return best, found
            continue
        left = _enter(box, first, ox, oy, oz, ix, iy, iz, best)
        right = _enter(box, first + 1, ox, oy, oz, ix, iy, iz, best)
        near, far = (first, first + 1) if left <= right else (first + 1, first)
        if max(left, right) < np.inf:
            stack[waiting] = far
            waiting += 1
        if min(left, right) < np.inf:
            stack[waiting] = near
            waiting += 1
    return (best, found) if found >= 0 else (np.inf, -1)


@compiled
def cast_many(
    mesh: Mesh, world: int, origins: Doubles, directions: Doubles
) -> tuple[Doubles, Ints]:
    """Distances (R,) and triangles (R,) along rays (R, 3); inf and -1 where nothing is."""
    count = len(origins)
    distance = np.empty(count, np.float64)
    triangle = np.empty(count, np.int32)
    corner, box, link, root = mesh.corner, mesh.box, mesh.link, mesh.root[world]
    for i in range(count):
        o, d = origins[i], directions[i]
        distance[i], triangle[i] = cast(
            corner, box, link, root, o[0], o[1], o[2], d[0], d[1], d[2], np.inf, False
        )
    return distance, triangle
