"""How good policies are in the tasks of a swarm, computed exactly from the tasks' models.

Interface: a :class:`Referee` for a swarm file; it judges parameters and returns :class:`Scores`.
A swarm of many agents has few different tasks: each is built and solved once.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import gymnasium
import msgspec
import numpy as np
from numpy.typing import NDArray

from agent.config.experiment import SwarmFile
from agent.learning.policies import softmax
from sim.tabular.env import TabularEnv
from sim.tabular.mdp import Floats
from sim.tabular.optimum import JointOptimum, joint_optimum

SOLVED = 0.5  # a task is solved when P(goal) - P(obstacle) exceeds this (notes to the paper)


@dataclass(frozen=True)
class Scores:
    """What N policies are worth in T different tasks.

    Attributes:
        value: (N,) sum of each policy's values over all agents' tasks.
        goal, obstacle: (T, N) probability to reach the goal, to hit an obstacle.
        optimum: V*, the largest sum that any policy reaches; None where nobody knows it.
    """

    value: Floats
    goal: Floats
    obstacle: Floats
    optimum: float | None

    @property
    def share(self) -> Floats:
        """(N,) V/V*, for tasks whose optimum is known."""
        assert self.optimum is not None
        return self.value / self.optimum

    @property
    def margins(self) -> Floats:
        """(T, N) P(goal) - P(obstacle)."""
        return self.goal - self.obstacle

    @property
    def solved(self) -> NDArray[np.intp]:
        """(N,) different tasks solved by each policy."""
        return np.asarray((self.margins > SOLVED).sum(axis=0))


class Referee:
    """Judge of a swarm's policies; builds the worlds and V* once.

    Attributes:
        tasks: (agents,) which of the T different tasks is whose, in the file's order.
        known: V* with its certificate, summed over all agents; None for tasks that move by chance
            or in different ways.
    """

    def __init__(self, config: SwarmFile) -> None:
        places: dict[bytes, int] = {}
        self._worlds: list[TabularEnv] = []
        order = []
        for agent in config.agents:
            task = msgspec.json.encode(agent.task)
            if task not in places:
                places[task] = len(places)
                self._worlds.append(_world(config, agent.id))
            order.append(places[task])
        self.tasks = np.array(order)
        self.known: JointOptimum | None
        try:
            self.known = joint_optimum([self._worlds[task].model for task in order])
        except ValueError:
            self.known = None

    @property
    def optimum(self) -> JointOptimum:
        """V* of tasks that have a known one."""
        assert self.known is not None
        return self.known

    def judge(self, thetas: Iterable[NDArray[np.floating]], chances: bool = True) -> Scores:
        """Score policies given as parameters (N, d); without ``chances`` by their value only.

        A critic's values may follow a policy's logits.
        """
        counts = np.bincount(self.tasks)
        values, goal, obstacle = [], [], []
        for theta in thetas:
            total, reached, hit = 0.0, [], []
            for world, count in zip(self._worlds, counts, strict=True):
                model = world.model
                logits = theta[: model.n_states * model.n_actions]
                policy = softmax(logits.reshape(model.n_states, model.n_actions))
                total += count * model.value(policy)
                if chances:
                    reached.append(model.reach_probability(policy, world.goal_states))
                    hit.append(model.reach_probability(policy, world.obstacle_states))
            values.append(total)
            goal.append(reached)
            obstacle.append(hit)
        bound = None if self.known is None else self.known.bound
        return Scores(np.array(values), np.array(goal).T, np.array(obstacle).T, bound)


def _world(config: SwarmFile, agent: str) -> TabularEnv:
    """The tabular world of an agent's task."""
    task = config.agents[config.index(agent)].task
    kwargs: dict[str, Any] = {"gamma": config.estimator.gamma} | task.kwargs
    env = gymnasium.make(task.env, **kwargs).unwrapped
    assert isinstance(env, TabularEnv)
    return env
