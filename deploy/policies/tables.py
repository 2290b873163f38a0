"""What policies of tabular tasks are worth, computed exactly from the tasks' models."""

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from agent.config.experiment import SwarmFile
from deploy.policies.scoring import SOLVED, Referee
from swarm.mixing.consensus import consensus_errors

WIDE = 4  # agents up to which the table has a column for each one's policy: 80 columns hold no more
ROWS = 8  # tasks up to which it has a row for each agent's; above, for each different task


class TabularScores(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True,
    tag_field="kind", tag="tabular",
):  # fmt: skip
    """What every agent's policy is worth in every agent's task.

    Attributes:
        tasks: id of the agent whose task it is, in the file's order.
        goal, obstacle: ``[task][agent]`` probability to reach the goal, to hit an obstacle.
        solved: ``[agent]`` number of tasks solved by its policy.
        value: ``[agent]`` sum over tasks of its policy's value.
        optimum: V*, the largest sum that any policy reaches; None where nobody knows it (tasks
            that move by chance or in different ways).
        consensus_error: ``[agent]`` distance from the mean parameters.
    """

    tasks: tuple[str, ...]
    goal: list[list[float]]
    obstacle: list[list[float]]
    solved: list[int]
    value: list[float]
    optimum: float | None
    consensus_error: list[float]


def tabular_scores(config: SwarmFile, thetas: NDArray[np.floating]) -> TabularScores:
    """Every agent's policy, theta (N, d), in every agent's task."""
    referee = Referee(config)
    scores = referee.judge(thetas)
    return TabularScores(
        tasks=config.members,
        goal=scores.goal[referee.tasks].tolist(),
        obstacle=scores.obstacle[referee.tasks].tolist(),
        solved=(scores.margins[referee.tasks] > SOLVED).sum(axis=0).tolist(),
        value=scores.value.tolist(),
        optimum=scores.optimum,
        consensus_error=consensus_errors(thetas).tolist(),
    )


def print_tables(scores: TabularScores, rounds: int, console: Console) -> None:
    """The table, and the lines that sum it up."""
    console.print(chances(scores, rounds))
    line = f"tasks solved: {min(scores.solved)} of {len(scores.tasks)} by every agent's policy"
    low, high = min(scores.value), max(scores.value)
    if scores.optimum is None:
        console.print(f"{line}; sum of values {low:.3f} to {high:.3f}")
    else:
        low, high = low / scores.optimum, high / scores.optimum
        console.print(f"{line}; V/V* {low:.3f} to {high:.3f} (V* {scores.optimum:.3f})")
    console.print(f"final consensus error: {max(scores.consensus_error):.4f} (largest of all)")


def chances(scores: TabularScores, rounds: int) -> Table:
    """Chances per task, under each agent's policy or (many agents) under the worst and the mean.

    Many agents share few tasks: rows that would be the same are one.
    """
    table = Table(title=f"P(goal) / P(obstacle) after {rounds} rounds")
    table.add_column("task of", overflow="fold")
    each = len(scores.tasks) <= WIDE
    for heading in [f"policy of {a}" for a in scores.tasks] if each else ["worst", "mean"]:
        table.add_column(heading, justify="right")
    for task, row in _rows(scores):
        pairs = row
        if not each:
            goal, obstacle = np.mean(row, axis=0)
            pairs = [min(row, key=lambda pair: pair[0] - pair[1]), (float(goal), float(obstacle))]
        table.add_row(task, *(f"{g:.3f} / {o:.3f}" for g, o in pairs))
    return table


def _rows(scores: TabularScores) -> list[tuple[str, Sequence[tuple[float, float]]]]:
    """Whose task it is, and (goal, obstacle) under each policy."""
    found = [
        (task, tuple(zip(goal, obstacle, strict=True)))
        for task, goal, obstacle in zip(scores.tasks, scores.goal, scores.obstacle, strict=True)
    ]
    if len(found) <= ROWS:
        return [(task, pairs) for task, pairs in found]
    owners: dict[tuple[tuple[float, float], ...], list[str]] = {}
    for task, pairs in found:
        owners.setdefault(pairs, []).append(task)
    return [
        (agents[0] if len(agents) == 1 else f"{agents[0]} and {len(agents) - 1} more", pairs)
        for pairs, agents in owners.items()
    ]
