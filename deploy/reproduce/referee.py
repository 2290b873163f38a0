"""How good learned policies are, exactly: in every task of a swarm, beside the true optimum."""

from collections.abc import Iterable
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from agent.config.experiment import SwarmFile
from agent.learning.policies import softmax
from deploy.policies.report import SOLVED, task_env
from sim.tabular.env import TabularEnv
from sim.tabular.mdp import Floats
from sim.tabular.optimum import JointOptimum, joint_optimum


@dataclass(frozen=True)
class Scores:
    """What N policies are worth.

    Attributes:
        share: (N,) V/V*, the sum over all agents' tasks beside the best that any policy reaches.
        margins: (T, N) P(goal) - P(obstacle) in each distinct task.
    """

    share: Floats
    margins: Floats

    @property
    def solved(self) -> NDArray[np.intp]:
        """(N,) distinct tasks solved by each policy."""
        return np.asarray((self.margins > SOLVED).sum(axis=0))


class Referee:
    """Judge of a swarm's policies; builds the worlds and V* once.

    Attributes:
        optimum: V* with its certificate, summed over all agents.
    """

    def __init__(self, config: SwarmFile) -> None:
        self._worlds: dict[bytes, tuple[TabularEnv, int]] = {}
        for agent in config.agents:
            task = msgspec.json.encode(agent.task)
            world, count = self._worlds.get(task, (None, 0))
            self._worlds[task] = world or task_env(config, agent.id), count + 1
        models = [world.model for world, count in self._worlds.values() for _ in range(count)]
        self.optimum: JointOptimum = joint_optimum(models)

    def judge(self, thetas: Iterable[NDArray[np.floating]], margins: bool = True) -> Scores:
        """Score policies given as parameters (N, d); without ``margins`` by their value only."""
        shares, chances = [], []
        for theta in thetas:
            total, row = 0.0, []
            for world, count in self._worlds.values():
                model = world.model
                logits = theta[: model.n_states * model.n_actions]
                policy = softmax(logits.reshape(model.n_states, model.n_actions))
                total += count * model.value(policy)
                if margins:
                    row.append(
                        model.reach_probability(policy, world.goal_states)
                        - model.reach_probability(policy, world.obstacle_states)
                    )
            shares.append(total / self.optimum.bound)
            chances.append(row)
        return Scores(np.array(shares), np.array(chances).T)
