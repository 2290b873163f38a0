"""What a run has learned, computed exactly from the tasks' models."""

from typing import Any

import gymnasium
import msgspec
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from agent.config.experiment import SwarmFile
from agent.learning.policies import Tabular, softmax
from agent.storage.runfolder import RunFolder
from deploy.policies.summary import print_summary
from sim.tabular.env import TabularEnv
from sim.tabular.optimum import joint_optimum
from swarm.mixing.consensus import consensus_errors

SOLVED = 0.5  # a task is solved when P(goal) - P(obstacle) exceeds this (notes to the paper)
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


def task_env(config: SwarmFile, agent: str) -> TabularEnv:
    """The tabular world of an agent's task."""
    task = config.agents[config.index(agent)].task
    kwargs: dict[str, Any] = {"gamma": config.estimator.gamma} | task.kwargs
    env = gymnasium.make(task.env, **kwargs).unwrapped
    assert isinstance(env, TabularEnv)
    return env


def evaluate(config: SwarmFile, thetas: NDArray[np.floating]) -> Result:
    """Every agent's policy, theta (N, d), in every agent's task."""
    worlds = [task_env(config, agent) for agent in config.members]
    shape = (worlds[0].model.n_states, worlds[0].model.n_actions)
    # A critic's values may follow the logits.
    policies = [softmax(theta[: shape[0] * shape[1]].reshape(shape)) for theta in thetas]

    def table(states: list[NDArray[np.intp]]) -> NDArray[np.float64]:
        return np.array(
            [
                [world.model.reach_probability(policy, targets) for policy in policies]
                for world, targets in zip(worlds, states, strict=True)
            ]
        )

    goal = table([world.goal_states for world in worlds])
    obstacle = table([world.obstacle_states for world in worlds])
    value = [sum(world.model.value(policy) for world in worlds) for policy in policies]
    return Result(
        swarm=config.name,
        rounds=config.rounds,
        tasks=config.members,
        goal=goal.tolist(),
        obstacle=obstacle.tolist(),
        solved=(goal - obstacle > SOLVED).sum(axis=0).tolist(),
        value=value,
        optimum=_optimum(worlds),
        consensus_error=consensus_errors(thetas).tolist(),
    )


def _optimum(worlds: list[TabularEnv]) -> float | None:
    try:
        return joint_optimum([world.model for world in worlds]).bound
    except ValueError:
        return None


def report_result(folder: RunFolder, config: SwarmFile, record: bool) -> None:
    """Evaluate a finished run, keep the numbers, print the table, write the recording."""
    if not isinstance(config.policy, Tabular):
        print_summary(folder, config)
        return
    result = evaluate(config, np.stack([folder.newest(agent).theta for agent in config.members]))
    folder.result.write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=2))
    console = Console(highlight=False)
    console.print(result_table(result))
    line = f"tasks solved: {min(result.solved)} of {len(result.tasks)} by every agent's policy"
    low, high = min(result.value), max(result.value)
    if result.optimum is None:
        console.print(f"{line}; sum of values {low:.3f} to {high:.3f}")
    else:
        low, high = low / result.optimum, high / result.optimum
        console.print(f"{line}; V/V* {low:.3f} to {high:.3f} (V* {result.optimum:.3f})")
    console.print(f"final consensus error: {max(result.consensus_error):.4f} (largest of all)")
    if record and (recording := _record(folder, config)):
        console.print(f"recording: {recording}")
    console.print(f"run folder: {folder.path}", soft_wrap=True)


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


def _record(folder: RunFolder, config: SwarmFile) -> str | None:
    """Turn the run folder into a Rerun recording, where rerun-sdk is installed."""
    try:
        from deploy.viewer import record_run  # noqa: PLC0415
    except ImportError:
        return "none (rerun-sdk is not installed)"
    record_run(folder, config, folder.recording)
    return str(folder.recording)
