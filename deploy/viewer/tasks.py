"""The tasks' worlds: what stands still in them, and where things are.

A tabular task is a picture of cells: a grid world as its grid, any other as one row of states.
Units are cells; x is the column and y the row, from the top left.  Indoor worlds stand in
``rooms``; another kind of world is another class, and a line in :func:`world_of`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import gymnasium
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from agent.config.experiment import Task
from deploy.viewer import colours
from deploy.viewer.rooms import Room
from sim.indoor.content.scene import load
from sim.tabular.env import TabularEnv
from sim.tabular.gridworld import GridWorld

KINDS = ("free", "start", "goal", "obstacle")
FREE, START, GOAL, OBSTACLE = range(4)
FILL = (colours.FREE, colours.START, colours.GOAL, colours.TROUBLE)
MARGIN = 0.25  # [cells] around a world
INDOOR, DEFAULT = "IndoorFlight-v0", "indoor-long"  # as sim/indoor/flight/env.py has them


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
        """What never changes: names below the world's entity, and data."""
        rows, columns = self.cells.shape
        lines = [[(0, y), (columns, y)] for y in range(1, rows)]
        lines += [[(x, 0), (x, rows)] for x in range(1, columns)]
        legend = [(kind, KINDS[kind], FILL[kind]) for kind in range(len(KINDS))]
        yield "cells", rr.AnnotationContext(legend)
        yield "cells", rr.SegmentationImage(self.cells, opacity=1.0, draw_order=0.0)
        yield "lines", rr.LineStrips2D(lines, colors=[colours.LINES], radii=[0.02], draw_order=1.0)

    def moving(self, colour: colours.Colour) -> Iterator[tuple[str, rr.AsComponents]]:
        """How an agent of this ``colour`` is drawn in it, likewise."""
        path = rr.LineStrips2D.from_fields(colors=[colour], radii=[0.08], draw_order=2.0)
        drone = rr.Points2D.from_fields(colors=[colour], radii=[0.22], draw_order=3.0)
        yield "path", path
        yield "drone", drone

    def view(self, name: str, origin: str, contents: list[str]) -> rrb.View:
        """All of it, filling the view."""
        rows, columns = self.cells.shape
        bounds = rrb.VisualBounds2D(
            x_range=(-MARGIN, columns + MARGIN), y_range=(-MARGIN, rows + MARGIN)
        )
        return rrb.Spatial2DView(name=name, origin=origin, contents=contents, visual_bounds=bounds)


def world_of(task: Task) -> CellWorld | Room | None:
    """How to draw a task; None if that is not known, or the world is not installed here."""
    if task.env.rpartition(":")[2] == INDOOR:
        try:
            return Room.of(load(task.kwargs.get("scene", DEFAULT), lit=False))
        except (ValueError, TypeError, OSError, ImportError):
            return None
    try:
        env = gymnasium.make(task.env, **task.kwargs)
    except (gymnasium.error.Error, TypeError, ValueError, KeyError, ImportError):
        return None
    env.close()
    world = env.unwrapped
    return CellWorld.of(world) if isinstance(world, TabularEnv) else None
