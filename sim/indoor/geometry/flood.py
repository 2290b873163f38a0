"""Where a flight can get to: a flood over cells of air, and the hole through which it leaves.

Interface: :func:`find_leak`.  Air is a grid of cells; two neighbours are joined where the straight
line between their centres meets no surface.  A cell is smaller than the drone, so that no hole that
lets a drone through slips between the lines; a world with more than :data:`MOST_CELLS` of them gets
larger cells and a coarser answer.
"""

import numpy as np
import numpy.typing as npt

from sim.indoor.compiled import compiled
from sim.indoor.geometry.mesh import Doubles, Ints, Mesh
from sim.indoor.render.rays import cast

CELL = 0.1937  # m; odd, so that walls at round distances do not run through the cells' centres
MOST_CELLS = 4_000_000
WELD = 1e-4  # m, within which two corners are one


@compiled
def _flood(
    mesh: Mesh, world: int, start: Doubles, cell: float, first: Ints, shape: Ints, parent: Ints
) -> int:
    """Flood from the cell of `start`; the first cell from which the air leaves the grid, or -1.

    `first` (3,) is the grid's lowest cell, counted from the start's; `parent` (cells,), -1
    throughout, becomes the cell that each was reached from.
    """
    root = mesh.root[world]
    origin = -first
    home = (origin[0] * shape[1] + origin[1]) * shape[2] + origin[2]
    parent[home] = home
    waiting = np.empty(len(parent), np.int32)
    waiting[0] = home
    head, tail = 0, 1
    index = np.empty(3, np.int64)
    place = np.empty(3, np.float64)
    while head < tail:
        here = waiting[head]
        head += 1
        index[2] = here % shape[2]
        index[1] = here // shape[2] % shape[1]
        index[0] = here // (shape[2] * shape[1])
        for axis in range(3):
            place[axis] = start[axis] + (first[axis] + index[axis]) * cell
        for axis in range(3):
            for way in (-1, 1):
                dx = float(way) if axis == 0 else 0.0
                dy = float(way) if axis == 1 else 0.0
                dz = float(way) if axis == 2 else 0.0
                there = index[axis] + way
                inside = 0 <= there < shape[axis]
                step = 1 if axis == 2 else (shape[2] if axis == 1 else shape[1] * shape[2])
                if inside and parent[here + way * step] >= 0:
                    continue
                _, wall = cast(
                    mesh.corner, mesh.box, mesh.link, root,
                    place[0], place[1], place[2], dx, dy, dz, cell, True,
                )  # fmt: skip
                if wall >= 0:
                    continue
                if not inside:
                    return int(here)
                parent[here + way * step] = here
                waiting[tail] = here + way * step
                tail += 1
    return -1


def find_leak(mesh: Mesh, start: Doubles, world: int = 0) -> Doubles | None:
    """Where a flight from `start` can leave the box around a world; None if nowhere.

    Args:
        mesh: one or several worlds.
        start: (3,) [m, NED], inside the box.
        world: which.

    Returns:
        (3,) [m, NED], near the hole: on the way out, the point nearest to a free edge.
    """
    box = mesh.box[mesh.root[world]].astype(np.float64)
    span = box[3:] - box[:3]
    cell = max(CELL, float(np.cbrt(np.prod(span) / MOST_CELLS)))
    first = np.ceil((box[:3] - start) / cell).astype(np.int32)
    shape = np.floor((box[3:] - start) / cell).astype(np.int32) - first + 1
    parent = np.full(int(np.prod(shape)), -1, np.int32)
    last = _flood(mesh, world, np.asarray(start, np.float64), cell, first, shape, parent)
    if last < 0:
        return None
    way = [last]
    while parent[way[-1]] != way[-1]:
        way.append(int(parent[way[-1]]))
    cells = np.stack(np.unravel_index(way, tuple(shape)), axis=1)
    points = start + (first + cells) * cell
    hole: Doubles = points[0]
    edges = free_edges(mesh)
    if len(edges):
        middles = edges.mean(axis=1)
        gaps = np.array([np.linalg.norm(middles - point, axis=1).min() for point in points])
        hole = points[int(np.argmin(gaps))]
    return hole


def free_edges(mesh: Mesh) -> npt.NDArray[np.float64]:
    """Edges that belong to one triangle only (E, 2, 3) [m, NED]: rims of holes, and of thin sheets.

    A file may weld its walls badly or not at all, so a free edge alone proves no hole.
    """
    corner = mesh.corner.astype(np.float64)
    _, names = np.unique(np.round(corner.reshape(-1, 3) / WELD), axis=0, return_inverse=True)
    names = names.reshape(-1, 3)
    ends = np.concatenate([names[:, [0, 1]], names[:, [1, 2]], names[:, [2, 0]]])
    places = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]])
    _, where, count = np.unique(
        np.sort(ends, axis=1), axis=0, return_index=True, return_counts=True
    )
    edges: npt.NDArray[np.float64] = places[where[count == 1]]
    return edges
