"""Grid worlds of any size, and the paper's five multi-task layouts (Sec. 5.1, Fig. 2).

States number the cells row by row, row 0 on top; actions are `UP`, `DOWN`, `LEFT`, `RIGHT`.
`grid_model` builds the exact world, `LAYOUTS` holds the layouts of the notes, `GridWorld` is the
Gymnasium environment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.tabular.env import TabularEnv
from sim.tabular.mdp import FiniteMDP

Cell = tuple[int, int]  # row, column

UP, DOWN, LEFT, RIGHT = range(4)
MOVES = np.array([(-1, 0), (1, 0), (0, -1), (0, 1)])  # (A, 2) rows, columns
ARROWS = "^v<>"
GAMMA = 0.99


@dataclass(frozen=True)
class Layout:
    """Several tasks on one grid: each has its own goal and obstacles, empty to the others."""

    start: Cell
    goals: tuple[Cell, ...]  # one per task
    obstacles: tuple[tuple[Cell, ...], ...]  # one group per task
    size: tuple[int, int] = (10, 10)  # rows, columns

    @property
    def n_tasks(self) -> int:
        return len(self.goals)

    def models(self, gamma: float = GAMMA) -> list[FiniteMDP]:
        """The exact world of every task."""
        return [
            grid_model(self.size, [goal], obstacles, start=self.start, gamma=gamma)
            for goal, obstacles in zip(self.goals, self.obstacles, strict=True)
        ]


def _cells(text: str) -> tuple[Cell, ...]:
    """'82 16' -> ((8, 2), (1, 6)): row, column."""
    return tuple((int(cell[0]), int(cell[1])) for cell in text.split())


def _layout(start: str, goals: str, obstacles: str) -> Layout:
    groups = tuple(_cells(group) for group in obstacles.split(";"))
    return Layout(_cells(start)[0], _cells(goals), groups)


_CROWDED = (
    "75 54 26 13 71 31",
    "07 47 65 99; 43 77 78 89; 13 24 88 97; 04 31 32 58; 28 45 62 81; 19 41 46 98",
)

LAYOUTS = {
    # No conflict: no task's goal is another's obstacle.
    "a": _layout("00", "82 16 57 22", "18 45 60 84; 29 62 70 89; 04 07 44 51; 13 14 33 77"),
    # A conflict that can be solved.
    "b": _layout("00", "55 47 43 18", "34 88 96 97; 27 43 53 77; 06 10 50 89; 28 54 59 65"),
    # A conflict that cannot: 15 and 41 are the goal of one task and an obstacle of the other.
    "c": _layout(
        "00", "63 15 41 81", "05 35 46 67 70; 02 30 41 42 79; 11 15 23 53 68; 14 25 45 61 76"
    ),
    # One world, two start corners: the first traps policy gradients, the second does not.
    "d": _layout("00", *_CROWDED),
    "e": _layout("09", *_CROWDED),
}


def grid_model(
    size: tuple[int, int],
    goals: Sequence[Cell],
    obstacles: Sequence[Cell] = (),
    *,
    start: Cell | None = None,
    start_distribution: ArrayLike | None = None,
    gamma: float = GAMMA,
) -> FiniteMDP:
    """The exact grid world: entering a goal pays +1, an obstacle -1; both end the episode.

    Starts in the cell `start`, by default the top left, or by `start_distribution` over the cells.
    """
    rows, columns = size
    if rows < 1 or columns < 1:
        raise ValueError(f"size: {size}, expected at least one row and one column")
    goal_states, obstacle_states = (
        _states("goals", goals, size),
        _states("obstacles", obstacles, size),
    )
    if common := set(goal_states) & set(obstacle_states):
        cell = divmod(min(common), columns)
        raise ValueError(f"obstacles: {cell} is a goal too, expected one or the other")
    payoff = np.zeros(rows * columns)
    payoff[goal_states], payoff[obstacle_states] = 1.0, -1.0
    terminal = payoff != 0

    states = np.arange(rows * columns)
    cells = np.stack(np.divmod(states, columns), axis=-1)
    moved = np.clip(cells[:, None] + MOVES, 0, (rows - 1, columns - 1))  # (S, A, 2): walls hold
    successors = moved @ (columns, 1)
    successors[terminal] = states[terminal, None]
    rewards = np.where(terminal[:, None], 0.0, payoff[successors])

    if start_distribution is None:
        (first,) = _states("start", [start or (0, 0)], size)
        if terminal[first]:
            raise ValueError(f"start: {start or (0, 0)} is a goal or an obstacle, expected neither")
        start_distribution = states == first
    elif start is not None:
        raise ValueError("start_distribution: start is given too, expected one of them")
    return FiniteMDP(
        successors=successors[:, :, None],
        probabilities=np.ones((*successors.shape, 1)),
        rewards=rewards[:, :, None],
        start=np.asarray(start_distribution, dtype=np.float64),
        terminal=terminal,
        gamma=gamma,
    )


def _states(name: str, cells: Sequence[Cell], size: tuple[int, int]) -> list[int]:
    rows, columns = size
    for row, column in cells:
        if not (0 <= row < rows and 0 <= column < columns):
            raise ValueError(
                f"{name}: cell {(row, column)}, expected one of a {rows} x {columns} grid"
            )
    return [row * columns + column for row, column in cells]


class GridWorld(TabularEnv):
    """A drone on a grid looks for its goal and keeps clear of its obstacles.

    ## Description
    One task of a multi-task grid world of the paper (Sec. 5.1), or a grid of your own.  Goals and
    obstacles of other tasks are empty cells here.

    ## Observation Space
    `Discrete(rows * columns)`: the cell, numbered row by row from the top left (unitless).

    ## Action Space
    `Discrete(4)`: 0 up, 1 down, 2 left, 3 right, one cell each.  A step into the wall stays.

    ## Rewards
    +1 on entering a goal, -1 on entering an obstacle, else 0.

    ## Starting State
    The cell `start`, or drawn from `start_distribution`.

    ## Episode End
    Terminates on a goal or an obstacle; truncated after `horizon` steps if that is given.

    ## Arguments
    * `layout`: "a" to "e" of the project's notes, with `task` in 0..n-1; or None, and then:
    * `size`: (rows, columns); `goals`, `obstacles`: cells (row, column).
    * `start`: a cell, by default the layout's or the top left; or
      `start_distribution`: (rows * columns,) probabilities.
    * `gamma`: discount of the exact model; `horizon`: steps, or None for no limit.
    * `render_mode`: "ansi" (text) or "rgb_array" ((16 rows, 16 columns, 3) uint8), or None.

    ## Attributes
    `model` is the exact `FiniteMDP`; `goal_states` and `obstacle_states` are its terminal states.
    """

    metadata: dict[str, Any] = {"render_modes": ["ansi", "rgb_array"], "render_fps": 4}  # noqa: RUF012  (Gymnasium declares it so)

    def __init__(
        self,
        layout: str | None = None,
        task: int | None = None,
        *,
        size: tuple[int, int] = (10, 10),
        goals: Sequence[Cell] = ((9, 9),),
        obstacles: Sequence[Cell] = (),
        start: Cell | None = None,
        start_distribution: ArrayLike | None = None,
        gamma: float = GAMMA,
        horizon: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        if layout is not None:
            if layout not in LAYOUTS:
                raise ValueError(f"layout: {layout!r}, expected one of {', '.join(LAYOUTS)}")
            plan = LAYOUTS[layout]
            if task is None or not 0 <= task < plan.n_tasks:
                raise ValueError(f"task: {task}, expected 0 to {plan.n_tasks - 1} in {layout!r}")
            size, goals, obstacles = plan.size, [plan.goals[task]], plan.obstacles[task]
            if start is None and start_distribution is None:
                start = plan.start
        elif task is not None:
            raise ValueError(f"task: {task}, expected None without a layout")
        model = grid_model(
            size, goals, obstacles, start=start, start_distribution=start_distribution, gamma=gamma
        )
        super().__init__(
            model,
            _states("goals", goals, size),
            _states("obstacles", obstacles, size),
            horizon,
            render_mode,
        )
        self.size = size

    def render(self) -> Any:
        """The grid as text (G goal, # obstacle, o drone) or as a picture, by `render_mode`."""
        if self.render_mode == "ansi":
            return self._text()
        return self._picture() if self.render_mode == "rgb_array" else None

    def _text(self) -> str:
        symbols = np.full(self.model.n_states, ".")
        symbols[self.goal_states], symbols[self.obstacle_states] = "G", "#"
        symbols[self._state] = "o"
        return "\n".join(map("".join, symbols.reshape(self.size))) + "\n"

    def _picture(self) -> NDArray[np.uint8]:
        colours = np.full((self.model.n_states, 3), 255, dtype=np.uint8)
        colours[self.goal_states] = (240, 200, 40)
        colours[self.obstacle_states] = (200, 50, 50)
        colours[self._state] = (60, 140, 90)
        return colours.reshape(*self.size, 3).repeat(16, axis=0).repeat(16, axis=1)
