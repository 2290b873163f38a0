"""The final numbers of a run over tabular tasks: ``result.json`` and the table of ``swarm up``."""

import msgspec
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from agent.config.experiment import SwarmFile
from deploy.policies.scoring import SOLVED, Referee
from swarm.mixing.consensus import consensus_errors

WIDE = 6  # agents up to which the table shows each one's chances


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """The final numbers of a run over tabular tasks; ``result.json``.

    Attributes:
        swarm: its name.
        rounds: played by every agent.
        tasks: id of the agent whose task it is, in the file's order.
        goal, obstacle: ``[task][agent]`` probability to reach the goal, to hit an obstacle.
        solved: ``[agent]`` number of tasks solved by its policy.
        value: ``[agent]`` sum over tasks of its policy's value.
        optimum: V*, the largest sum that any policy reaches; None where nobody knows it (tasks
            that move by chance or in different ways).
        consensus_error: ``[agent]`` distance from the mean parameters.
    """

    swarm: str
    rounds: int
    tasks: tuple[str, ...]
    goal: list[list[float]]
    obstacle: list[list[float]]
    solved: list[int]
    value: list[float]
    optimum: float | None
    consensus_error: list[float]


def result_of(config: SwarmFile, thetas: NDArray[np.floating]) -> Result:
    """Every agent's policy, theta (N, d), in every agent's task."""
    referee = Referee(config)
    scores = referee.judge(thetas)
    return Result(
        swarm=config.name,
        rounds=config.rounds,
        tasks=config.members,
        goal=scores.goal[referee.tasks].tolist(),
        obstacle=scores.obstacle[referee.tasks].tolist(),
        solved=(scores.margins[referee.tasks] > SOLVED).sum(axis=0).tolist(),
        value=scores.value.tolist(),
        optimum=scores.optimum,
        consensus_error=consensus_errors(thetas).tolist(),
    )


def print_result(result: Result, console: Console) -> None:
    """The table, and the line that sums it up."""
    console.print(result_table(result))
    line = f"tasks solved: {min(result.solved)} of {len(result.tasks)} by every agent's policy"
    low, high = min(result.value), max(result.value)
    if result.optimum is None:
        console.print(f"{line}; sum of values {low:.3f} to {high:.3f}")
    else:
        low, high = low / result.optimum, high / result.optimum
        console.print(f"{line}; V/V* {low:.3f} to {high:.3f} (V* {result.optimum:.3f})")
    console.print(f"final consensus error: {max(result.consensus_error):.4f} (largest of all)")


def result_table(result: Result) -> Table:
    """Chances per task, under each agent's policy or (many agents) under the worst and the mean."""
    table = Table(title=f"P(goal) / P(obstacle) after {result.rounds} rounds")
    table.add_column("task of")
    each = len(result.tasks) <= WIDE
    for heading in [f"policy of {a}" for a in result.tasks] if each else ["worst", "mean"]:
        table.add_column(heading, justify="right")
    for task, goal, obstacle in zip(result.tasks, result.goal, result.obstacle, strict=True):
        pairs = list(zip(goal, obstacle, strict=True))
        if not each:
            mean = (float(np.mean(goal)), float(np.mean(obstacle)))
            pairs = [min(pairs, key=lambda pair: pair[0] - pair[1]), mean]
        table.add_row(task, *(f"{g:.3f} / {o:.3f}" for g, o in pairs))
    return table
