"""A bounding volume hierarchy over triangles, built by the binned surface area heuristic.

Interface: ``build(corners)`` returns the order of the triangles, the nodes' boxes and their links
as ``mesh.Mesh`` keeps them; the two children of a node lie side by side.
Source: I. Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007.
"""

import numpy as np

from sim.indoor.compiled import compiled
from sim.indoor.geometry.mesh import Floats, Ints

BINS = 16
LEAF = 4  # triangles; measured: 2 and 8 render slower
DEPTH = 60  # levels; deeper nodes become leaves, so that a fixed stack of 64 always suffices


@compiled
def _area(box: Floats) -> float:
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return float(x * y + y * z + z * x)


@compiled
def _grow(box: Floats, low: Floats, high: Floats) -> None:
    for axis in range(3):
        box[axis] = min(box[axis], low[axis])
        box[axis + 3] = max(box[axis + 3], high[axis])


@compiled
def _empty(box: Floats) -> None:
    box[:3] = np.inf
    box[3:] = -np.inf


@compiled
def build(corner: Floats) -> tuple[Ints, Floats, Ints]:
    """``corner`` (T, 3, 3) -> order (T,), box (N, 6), link (N, 2); node 0 is the root."""
    count = len(corner)
    order = np.arange(count).astype(np.int32)
    low, high = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    for t in range(count):
        for axis in range(3):
            low[t, axis] = corner[t, :, axis].min()
            high[t, axis] = corner[t, :, axis].max()
    centre = (low + high) * np.float32(0.5)

    box = np.empty((2 * count, 6), np.float32)
    link = np.zeros((2 * count, 2), np.int32)
    tally = np.empty(BINS, np.int64)
    bins = np.empty((BINS, 6), np.float32)
    right_area = np.empty(BINS, np.float32)
    sweep = np.empty(6, np.float32)
    stack = [(0, 0, count, 0)]
    nodes = 1
    while len(stack) > 0:
        node, start, stop, level = stack.pop()
        _empty(box[node])
        for i in range(start, stop):
            _grow(box[node], low[order[i]], high[order[i]])
        link[node, 0], link[node, 1] = start, stop - start
        if stop - start <= 1 or level >= DEPTH:
            continue

        best_cost, best_axis, best_bin = np.inf, -1, 0
        for axis in range(3):
            first, last = np.inf, -np.inf
            for i in range(start, stop):
                first = min(first, centre[order[i], axis])
                last = max(last, centre[order[i], axis])
            if not last > first:
                continue
            scale = BINS * 0.9999 / (last - first)
            tally[:] = 0
            for b in range(BINS):
                _empty(bins[b])
            for i in range(start, stop):
                t = order[i]
                b = int((centre[t, axis] - first) * scale)
                tally[b] += 1
                _grow(bins[b], low[t], high[t])
            _empty(sweep)
            beyond = 0
            for b in range(BINS - 1, 0, -1):
                _grow(sweep, bins[b, :3], bins[b, 3:])
                beyond += tally[b]
                right_area[b] = _area(sweep) * beyond if beyond > 0 else 0.0
            _empty(sweep)
            before = 0
            for b in range(BINS - 1):
                _grow(sweep, bins[b, :3], bins[b, 3:])
                before += tally[b]
                if before == 0 or before == stop - start:
                    continue
                cost = _area(sweep) * before + right_area[b + 1]
                if cost < best_cost:
                    best_cost, best_axis, best_bin = cost, axis, b

        area = _area(box[node])
        if stop - start <= LEAF and (best_axis < 0 or best_cost + area > area * (stop - start)):
            continue
        middle = (start + stop) // 2
        if best_axis >= 0:
            first, last = np.inf, -np.inf
            for i in range(start, stop):
                first = min(first, centre[order[i], best_axis])
                last = max(last, centre[order[i], best_axis])
            scale = BINS * 0.9999 / (last - first)
            middle = start
            for i in range(start, stop):
                t = order[i]
                if int((centre[t, best_axis] - first) * scale) <= best_bin:
                    order[i], order[middle] = order[middle], t
                    middle += 1
        link[node, 0], link[node, 1] = nodes, 0
        stack.append((nodes, start, middle, level + 1))
        stack.append((nodes + 1, middle, stop, level + 1))
        nodes += 2
    return order, box[:nodes].copy(), link[:nodes].copy()
