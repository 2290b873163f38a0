"""The tasks' worlds: what stands still in them, and where things are.

A tabular task is a picture of cells: a grid world as its grid, any other as one row of states.
Units are cells; x is the column and y the row, from the top left.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import gymnasium
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from agent.config import Task
from deploy.viewer import colours
from sim.tabular.env import TabularEnv
from sim.tabular.gridworld import GridWorld

KINDS = ("free", "start", "goal", "obstacle")
FREE, START, GOAL, OBSTACLE = range(4)
FILL = (colours.FREE, colours.START, colours.GOAL, colours.TROUBLE)
MARGIN = 0.25  # [cells] around a world


@dataclass(frozen=True, slots=True, eq=False)
class CellWorld:
    """A tabular task.

    Attributes:
        cells: (rows, columns) which of :data:`KINDS` each state is.
    """

    cells: NDArray[np.uint8]

    @classmethod
    def of(cls, world: TabularEnv) -> Self:
        """The picture of a world."""
        cells = np.full(world.model.n_states, FREE, np.uint8)
        cells[world.model.start > 0] = START
        cells[world.goal_states], cells[world.obstacle_states] = GOAL, OBSTACLE
        return cls(cells.reshape(world.size if isinstance(world, GridWorld) else (1, -1)))

    def centres(self, states: Sequence[int] | NDArray[np.intp]) -> NDArray[np.float64]:
        """(n, 2) x and y of these states."""
        rows, columns = np.divmod(np.asarray(states, np.intp), self.cells.shape[1])
        return np.stack([columns, rows], axis=-1) + 0.5

    def still(self) -> Iterator[tuple[str, rr.AsComponents]]:
        """What never moves: names below the world's entity, and data."""
        rows, columns = self.cells.shape
        lines = [[(0, y), (columns, y)] for y in range(1, rows)]
        lines += [[(x, 0), (x, rows)] for x in range(1, columns)]
        legend = [(kind, KINDS[kind], FILL[kind]) for kind in range(len(KINDS))]
        yield "cells", rr.AnnotationContext(legend)
        yield "cells", rr.SegmentationImage(self.cells, opacity=1.0, draw_order=0.0)
        yield "lines", rr.LineStrips2D(lines, colors=[colours.LINES], radii=[0.02], draw_order=1.0)

    def view(self, name: str, origin: str) -> rrb.View:
        """All of it, filling the view."""
        rows, columns = self.cells.shape
        bounds = rrb.VisualBounds2D(
            x_range=(-MARGIN, columns + MARGIN), y_range=(-MARGIN, rows + MARGIN)
        )
        return rrb.Spatial2DView(name=name, origin=origin, visual_bounds=bounds)


def world_of(task: Task) -> CellWorld | None:
    """How to draw a task; None if that is not known, or the world is not installed here."""
    try:
        env = gymnasium.make(task.env, **task.kwargs)
    except (gymnasium.error.Error, TypeError, ValueError, KeyError, ImportError):
        return None
    env.close()
    world = env.unwrapped
    return CellWorld.of(world) if isinstance(world, TabularEnv) else None
