"""Which triangle each pixel sees: one walk through the tree, front to back, without hidden parts.

Method.  A point p of the world is written q = (X, Y, W) with p - eye = X right + Y down + W (corner
ray), where `right` and `down` are one pixel wide: its pixel is (X/W, Y/W), its depth along the
optical axis is W.  Edge functions are the cross products of corners in q (Olano and Greer,
"Triangle scan conversion using 2D homogeneous coordinates", 1997), so that triangles need no
clipping, not even those that reach behind the camera.  1/depth is linear over the picture.

Watertight: a shared edge has the same crossing in every row for both its triangles, computed in
double precision by the same operations, and a pixel centre on the edge belongs to both.

Occlusion: `far` keeps, for tiles of 8 x 8 pixels, the least 1/depth drawn (0: not full yet); a node
whose nearest corner lies behind it in all its tiles is skipped with everything in it.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim.indoor.compiled import compiled
from sim.indoor.geometry.mesh import Doubles, Floats, Ints, Mesh

SHIFT = 3
TILE = 1 << SHIFT  # pixels
NEAR = 1e-6  # m; what is closer is treated as reaching behind the camera

Flags = npt.NDArray[np.bool_]


class Canvas(NamedTuple):
    """Work space of one camera: it belongs to a renderer and is overwritten by every picture."""

    inverse: Floats  # (H, W) 1/depth [1/m], 0 where nothing is
    owner: Ints  # (H, W) slot of the triangle seen
    far: Floats  # (H/8, W/8) least 1/depth of the tile
    stale: Flags  # (H/8, W/8) whether `far` must be counted again
    triangle: Ints  # (T,) the triangle in a slot
    plane: Floats  # (T, 3) 1/depth = plane . (x, y, 1)
    surface: Floats  # (T, 17) four surface coordinates, u and v of the texture [texels], a and b of
    #   the lightmap, each as 4 numbers f: depth * f[:3] . (x, y, 1) + f[3]; last, texels a pixel at
    #   depth one, to be multiplied by depth^3


def canvas(height: int, width: int, triangles: int) -> Canvas:
    rows, columns = -(-height // TILE), -(-width // TILE)
    return Canvas(
        inverse=np.zeros((height, width), np.float32),
        owner=np.zeros((height, width), np.int32),
        far=np.zeros((rows, columns), np.float32),
        stale=np.zeros((rows, columns), np.bool_),
        triangle=np.empty(triangles, np.int32),
        plane=np.empty((triangles, 3), np.float32),
        surface=np.empty((triangles, 17), np.float32),
    )


@compiled
def _refresh(inverse: Floats, far: Floats, stale: Flags, row: int, column: int) -> None:
    height, width = inverse.shape
    least = np.float32(np.inf)
    for y in range(row * TILE, min(row * TILE + TILE, height)):
        for x in range(column * TILE, min(column * TILE + TILE, width)):
            least = min(least, inverse[y, x])
    far[row, column] = least
    stale[row, column] = False


@compiled
def _hidden(
    inverse: Floats,
    far: Floats,
    stale: Flags,
    left: float,
    right: float,
    top: float,
    bottom: float,
    nearest: float,
) -> bool:
    """Whether everything drawn in this part of the picture is nearer than `nearest` (1/depth)."""
    for row in range(int(top) >> SHIFT, (int(bottom) >> SHIFT) + 1):
        for column in range(int(left) >> SHIFT, (int(right) >> SHIFT) + 1):
            if far[row, column] < nearest:
                if not stale[row, column]:
                    return False
                _refresh(inverse, far, stale, row, column)
                if far[row, column] < nearest:
                    return False
    return True


@compiled
def _visible(
    inverse: Floats,
    far: Floats,
    stale: Flags,
    box: Floats,
    node: int,
    pixel_from_world: Doubles,
    eye: Doubles,
) -> bool:
    """Whether a node's box is inside the picture and not behind what is drawn already."""
    height, width = inverse.shape
    m = pixel_from_world
    x0, y0, z0 = box[node, 0] - eye[0], box[node, 1] - eye[1], box[node, 2] - eye[2]
    dx, dy = box[node, 3] - box[node, 0], box[node, 4] - box[node, 1]
    dz = box[node, 5] - box[node, 2]
    w_base = m[2, 0] * x0 + m[2, 1] * y0 + m[2, 2] * z0
    w_x, w_y, w_z = m[2, 0] * dx, m[2, 1] * dy, m[2, 2] * dz
    w_max = w_base + max(w_x, 0.0) + max(w_y, 0.0) + max(w_z, 0.0)
    if w_max <= NEAR:
        return False
    w_min = w_base + min(w_x, 0.0) + min(w_y, 0.0) + min(w_z, 0.0)
    x_base = m[0, 0] * x0 + m[0, 1] * y0 + m[0, 2] * z0
    x_x, x_y, x_z = m[0, 0] * dx, m[0, 1] * dy, m[0, 2] * dz
    y_base = m[1, 0] * x0 + m[1, 1] * y0 + m[1, 2] * z0
    y_x, y_y, y_z = m[1, 0] * dx, m[1, 1] * dy, m[1, 2] * dz
    # half-spaces X >= 0, X <= (width - 1) W and the same for Y: outside one of them, out of sight
    if x_base + max(x_x, 0.0) + max(x_y, 0.0) + max(x_z, 0.0) < 0.0:
        return False
    if y_base + max(y_x, 0.0) + max(y_y, 0.0) + max(y_z, 0.0) < 0.0:
        return False
    e = width - 1.0
    if (
        x_base
        - e * w_base
        + min(x_x - e * w_x, 0.0)
        + min(x_y - e * w_y, 0.0)
        + min(x_z - e * w_z, 0.0)
    ) > 0.0:
        return False
    e = height - 1.0
    if (
        y_base
        - e * w_base
        + min(y_x - e * w_x, 0.0)
        + min(y_y - e * w_y, 0.0)
        + min(y_z - e * w_z, 0.0)
    ) > 0.0:
        return False
    if w_min <= NEAR:
        return True
    left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    for k in range(8):
        a, b, c = float(k & 1), float((k >> 1) & 1), float(k >> 2)
        scale = 1.0 / (w_base + a * w_x + b * w_y + c * w_z)
        x = (x_base + a * x_x + b * x_y + c * x_z) * scale
        y = (y_base + a * y_x + b * y_y + c * y_z) * scale
        left, right = min(left, x), max(right, x)
        top, bottom = min(top, y), max(bottom, y)
    left, right = max(left, 0.0), min(right, width - 1.0)
    top, bottom = max(top, 0.0), min(bottom, height - 1.0)
    return not _hidden(inverse, far, stale, left, right, top, bottom, 1.0 / w_min)


@compiled
def _crossing(a: float, b: float, c: float) -> tuple[float, float]:
    """The edge a x + b y + c = 0 as x = slope y + start."""
    scale = -1.0 / a
    return b * scale, c * scale


@compiled
def _draw(
    inverse: Floats,
    owner: Ints,
    far: Floats,
    stale: Flags,
    plane: Floats,
    slot: int,
    corner: Floats,
    t: int,
    pixel_from_world: Doubles,
    eye: Doubles,
    two_sided: bool,
) -> bool:
    """Draw triangle `t` into `inverse` and `owner`; False if no pixel can see it."""
    height, width = inverse.shape
    m = pixel_from_world
    x, y, z = corner[t, 0, 0] - eye[0], corner[t, 0, 1] - eye[1], corner[t, 0, 2] - eye[2]
    ax = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
    ay = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
    aw = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
    x, y, z = corner[t, 1, 0] - eye[0], corner[t, 1, 1] - eye[1], corner[t, 1, 2] - eye[2]
    bx = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
    by = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
    bw = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
    x, y, z = corner[t, 2, 0] - eye[0], corner[t, 2, 1] - eye[1], corner[t, 2, 2] - eye[2]
    cx = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
    cy = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
    cw = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
    if max(aw, bw, cw) <= NEAR:
        return False
    bc0, bc1, bc2 = by * cw - bw * cy, bw * cx - bx * cw, bx * cy - by * cx
    det = ax * bc0 + ay * bc1 + aw * bc2
    if det == 0.0 or (det > 0.0 and not two_sided):  # faces are wound counter-clockwise
        return False
    ca0, ca1, ca2 = cy * aw - cw * ay, cw * ax - cx * aw, cx * ay - cy * ax
    ab0, ab1, ab2 = ay * bw - aw * by, aw * bx - ax * bw, ax * by - ay * bx

    first, last, limit_l, limit_r = 0.0, height - 1.0, 0.0, width - 1.0
    if min(aw, bw, cw) > NEAR:
        ia, ib, ic = 1.0 / aw, 1.0 / bw, 1.0 / cw
        ua, ub, uc = ay * ia, by * ib, cy * ic
        first = max(first, np.ceil(min(ua, ub, uc)))
        last = min(last, np.floor(max(ua, ub, uc)))
        if first > last:
            return False
        ua, ub, uc = ax * ia, bx * ib, cx * ic
        limit_l = max(limit_l, np.ceil(min(ua, ub, uc)))
        limit_r = min(limit_r, np.floor(max(ua, ub, uc)))
        if limit_l > limit_r:
            return False
        if _hidden(inverse, far, stale, limit_l, limit_r, first, last, max(ia, ib, ic)):
            return False

    # every edge bounds a row on its left or on its right, or, where it is level, bounds the rows
    sign = 1.0 if det > 0.0 else -1.0
    scale = 1.0 / det
    p0, p1, p2 = (ab0 + bc0 + ca0) * scale, (ab1 + bc1 + ca1) * scale, (ab2 + bc2 + ca2) * scale
    ls0 = ls1 = ls2 = rs0 = rs1 = rs2 = 0.0
    lk0 = lk1 = lk2 = -1.0
    rk0 = rk1 = rk2 = width + 0.0
    e0, e1, e2 = ab0 * sign, ab1 * sign, ab2 * sign
    if e0 > 0.0:
        ls0, lk0 = _crossing(e0, e1, e2)
    elif e0 < 0.0:
        rs0, rk0 = _crossing(e0, e1, e2)
    elif e1 > 0.0:
        first = max(first, np.ceil(-e2 / e1))
    elif e1 < 0.0:
        last = min(last, np.floor(-e2 / e1))
    e0, e1, e2 = bc0 * sign, bc1 * sign, bc2 * sign
    if e0 > 0.0:
        ls1, lk1 = _crossing(e0, e1, e2)
    elif e0 < 0.0:
        rs1, rk1 = _crossing(e0, e1, e2)
    elif e1 > 0.0:
        first = max(first, np.ceil(-e2 / e1))
    elif e1 < 0.0:
        last = min(last, np.floor(-e2 / e1))
    e0, e1, e2 = ca0 * sign, ca1 * sign, ca2 * sign
    if e0 > 0.0:
        ls2, lk2 = _crossing(e0, e1, e2)
    elif e0 < 0.0:
        rs2, rk2 = _crossing(e0, e1, e2)
    elif e1 > 0.0:
        first = max(first, np.ceil(-e2 / e1))
    elif e1 < 0.0:
        last = min(last, np.floor(-e2 / e1))

    drawn = False
    q0 = np.float32(p0)
    if not 0.0 <= first <= last <= height - 1.0:  # also where an edge is NaN: no int() of that
        return False
    for row in range(int(first), int(last) + 1):
        yf = float(row)
        left = np.ceil(max(limit_l, ls0 * yf + lk0, ls1 * yf + lk1, ls2 * yf + lk2))
        right = np.floor(min(limit_r, rs0 * yf + rk0, rs1 * yf + rk1, rs2 * yf + rk2))
        if not limit_l <= left <= right <= limit_r:  # also where one is NaN
            continue
        base = np.float32(p1 * yf + p2)
        for column in range(int(left), int(right) + 1):
            value = q0 * np.float32(column) + base
            if value > inverse[row, column]:
                inverse[row, column] = value
                owner[row, column] = slot
                drawn = True
    if not drawn:
        return False
    plane[slot, 0], plane[slot, 1], plane[slot, 2] = p0, p1, p2
    stale[
        int(first) // TILE : int(last) // TILE + 1, int(limit_l) // TILE : int(limit_r) // TILE + 1
    ] = True
    return True


@compiled
def _distance(box: Floats, node: int, eye: Doubles) -> float:
    """Squared distance from the eye to a node's box."""
    total = 0.0
    for axis in range(3):
        gap = max(box[node, axis] - eye[axis], eye[axis] - box[node, axis + 3], 0.0)
        total += gap * gap
    return total


@compiled
def see(canvas: Canvas, mesh: Mesh, world: int, pixel_from_world: Doubles, eye: Doubles) -> int:
    """Fill `inverse` and `owner` with what the eye sees; the number of triangles drawn."""
    # bare arrays, not tuples of them, go to the inner functions: each tuple costs 100 ns a call
    inverse, owner, far, stale = canvas.inverse, canvas.owner, canvas.far, canvas.stale
    plane, corner, box, link = canvas.plane, mesh.corner, mesh.box, mesh.link
    inverse[:] = 0.0
    far[:] = 0.0
    stale[:] = False
    two_sided = mesh.two_sided[world]
    stack = np.empty(128, np.int32)
    stack[0] = mesh.root[world]
    waiting = 1
    slot = 0
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if not _visible(inverse, far, stale, box, node, pixel_from_world, eye):
            continue
        first, count = link[node, 0], link[node, 1]
        if count == 0:
            if _distance(box, first, eye) < _distance(box, first + 1, eye):
                stack[waiting], stack[waiting + 1] = first + 1, first
            else:
                stack[waiting], stack[waiting + 1] = first, first + 1
            waiting += 2
            continue
        for t in range(first, first + count):
            if _draw(
                inverse, owner, far, stale, plane, slot, corner, t, pixel_from_world, eye, two_sided
            ):
                canvas.triangle[slot] = t
                slot += 1
    _close_seams(inverse, owner)
    return slot


@compiled
def _close_seams(inverse: Floats, owner: Ints) -> None:
    """A single empty pixel between two full ones is a seam of the mesh: it takes its left side."""
    height, width = inverse.shape
    for y in range(height):
        for x in range(1, width - 1):
            if inverse[y, x] == 0.0 and inverse[y, x - 1] > 0.0 and inverse[y, x + 1] > 0.0:
                inverse[y, x] = inverse[y, x - 1]
                owner[y, x] = owner[y, x - 1]
