"""Touching the world: how near its surfaces are, and how far a sphere moves before it meets one.

The drone is a sphere.  ``sweep`` moves it along a straight line: a triangle is met by its face, one
of its edges or one of its corners, whichever comes first.  A sphere that touches already may leave
but not go deeper.  Source: C. Ericson, "Real-Time Collision Detection", 2005, 5.1.5 and 5.5.
"""

import numpy as np

from sim.indoor.compiled import compiled
from sim.indoor.geometry.mesh import Doubles, Floats, Ints, Mesh


@compiled
def _dot(a: Doubles, b: Doubles) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@compiled
def _nearest(p: Doubles, a: Doubles, b: Doubles, c: Doubles, out: Doubles) -> None:
    """The point of a triangle nearest to `p` (Ericson 5.1.5)."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        out[:] = a
        return
    bp = p - b
    d3, d4 = _dot(ab, bp), _dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        out[:] = b
        return
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        out[:] = a + (d1 / (d1 - d3)) * ab
        return
    cp = p - c
    d5, d6 = _dot(ab, cp), _dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        out[:] = c
        return
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        out[:] = a + (d2 / (d2 - d6)) * ac
        return
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        out[:] = b + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (c - b)
        return
    scale = 1.0 / (va + vb + vc)
    out[:] = a + ab * (vb * scale) + ac * (vc * scale)


@compiled
def clearance(mesh: Mesh, world: int, point: Doubles, limit: float) -> float:
    """Distance [m] from a point to the nearest surface, at most `limit`."""
    best = limit * limit
    nearest = np.empty(3, np.float64)
    stack = np.empty(128, np.int32)
    stack[0] = mesh.root[world]
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        gap = 0.0
        for axis in range(3):
            low, high = mesh.box[node, axis], mesh.box[node, axis + 3]
            gap += max(low - point[axis], point[axis] - high, 0.0) ** 2
        if gap >= best:
            continue
        first, count = mesh.link[node, 0], mesh.link[node, 1]
        if count == 0:
            stack[waiting], stack[waiting + 1] = first, first + 1
            waiting += 2
            continue
        for t in range(first, first + count):
            a = mesh.corner[t, 0].astype(np.float64)
            b = mesh.corner[t, 1].astype(np.float64)
            c = mesh.corner[t, 2].astype(np.float64)
            _nearest(point, a, b, c, nearest)
            nearest -= point
            best = min(best, _dot(nearest, nearest))
    return float(np.sqrt(best))


@compiled
def _meet_corner(p: Doubles, move: Doubles, radius: float, q: Doubles) -> float:
    """When a moving sphere meets a point; 2 if it does not."""
    m = p - q
    b, c = _dot(m, move), _dot(m, m) - radius * radius
    if b >= 0.0:  # not approaching
        return 2.0
    if c <= 0.0:
        return 0.0
    a = _dot(move, move)
    root = b * b - a * c
    if root < 0.0:
        return 2.0
    return float((-b - np.sqrt(root)) / a)


@compiled
def _meet_edge(p: Doubles, move: Doubles, radius: float, q: Doubles, r: Doubles) -> float:
    """When a moving sphere meets the inner part of a segment; 2 if it does not."""
    axis, m = r - q, p - q
    length = _dot(axis, axis)
    if length == 0.0:
        return 2.0
    along, drift = _dot(m, axis), _dot(move, axis)
    a = _dot(move, move) - drift * drift / length
    b = _dot(m, move) - along * drift / length
    c = _dot(m, m) - along * along / length - radius * radius
    if b >= 0.0 or a <= 1e-15:
        return 2.0
    root = b * b - a * c
    if root < 0.0:
        return 2.0
    time = max((-b - np.sqrt(root)) / a, 0.0)
    place = along + time * drift
    return time if 0.0 <= place <= length else 2.0


@compiled
def _meet(p: Doubles, move: Doubles, radius: float, a: Doubles, b: Doubles, c: Doubles) -> float:
    """When (0..1 of the move) a sphere meets a triangle; more than 1 if it does not."""
    ab, ac = b - a, c - a
    normal = np.empty(3, np.float64)
    normal[0] = ab[1] * ac[2] - ab[2] * ac[1]
    normal[1] = ab[2] * ac[0] - ab[0] * ac[2]
    normal[2] = ab[0] * ac[1] - ab[1] * ac[0]
    size = np.sqrt(_dot(normal, normal))
    if size > 0.0:
        normal /= size
        height, speed = _dot(p - a, normal), _dot(move, normal)
        if height < 0.0:
            height, speed = -height, -speed
            normal = -normal
        if height > radius and speed >= 0.0:
            return 2.0  # above the plane and not coming nearer
        if speed < 0.0:
            time = max((radius - height) / speed, 0.0)
            if time > 1.0:
                return 2.0
            q = p + move * time - normal * (height + speed * time)
            # inside all three edges: the face is what is met first
            inside = True
            for k in range(3):
                start = a if k == 0 else (b if k == 1 else c)
                end = b if k == 0 else (c if k == 1 else a)
                e, f = end - start, q - start
                side = (
                    (e[1] * f[2] - e[2] * f[1]) * normal[0]
                    + (e[2] * f[0] - e[0] * f[2]) * normal[1]
                    + (e[0] * f[1] - e[1] * f[0]) * normal[2]
                )
                third = c if k == 0 else (a if k == 1 else b)
                g = third - start
                towards = (
                    (e[1] * g[2] - e[2] * g[1]) * normal[0]
                    + (e[2] * g[0] - e[0] * g[2]) * normal[1]
                    + (e[0] * g[1] - e[1] * g[0]) * normal[2]
                )
                inside &= side * towards >= 0.0
            if inside:
                return time
    time = min(
        _meet_edge(p, move, radius, a, b),
        _meet_edge(p, move, radius, b, c),
        _meet_edge(p, move, radius, c, a),
    )
    return min(
        time,
        _meet_corner(p, move, radius, a),
        _meet_corner(p, move, radius, b),
        _meet_corner(p, move, radius, c),
    )


@compiled
def sweep(
    corner: Floats,
    box: Floats,
    link: Ints,
    root: int,
    start: Doubles,
    move: Doubles,
    radius: float,
) -> float:
    """Share (0..1) of the move that a sphere can make before it touches; inf if it stays free."""
    low, high = np.empty(3, np.float64), np.empty(3, np.float64)
    for axis in range(3):
        low[axis] = min(start[axis], start[axis] + move[axis]) - radius
        high[axis] = max(start[axis], start[axis] + move[axis]) + radius
    best = 2.0
    a, b, c = np.empty(3, np.float64), np.empty(3, np.float64), np.empty(3, np.float64)
    stack = np.empty(128, np.int32)
    stack[0] = root
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        apart = False
        for axis in range(3):
            apart |= box[node, axis] > high[axis] or box[node, axis + 3] < low[axis]
        if apart:
            continue
        first, count = link[node, 0], link[node, 1]
        if count == 0:
            stack[waiting], stack[waiting + 1] = first, first + 1
            waiting += 2
            continue
        for t in range(first, first + count):
            for axis in range(3):
                a[axis] = corner[t, 0, axis]
                b[axis] = corner[t, 1, axis]
                c[axis] = corner[t, 2, axis]
            best = min(best, _meet(start, move, radius, a, b, c))
    return best if best <= 1.0 else np.inf
