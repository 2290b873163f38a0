"""The Gymnasium face of a finite world whose model may be asked for."""

from abc import ABC, abstractmethod
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete
from numpy.typing import ArrayLike

from sim.tabular.mdp import FiniteMDP, Ints


class TabularEnv(gymnasium.Env[np.int64, np.int64], ABC):
    """Steps through a `FiniteMDP` one transition at a time; subclasses say which, and draw it.

    `model` is the exact world; `goal_states` and `obstacle_states` are those terminal states of it
    that are worth reaching and worth avoiding.
    """

    def __init__(
        self,
        model: FiniteMDP,
        goal_states: ArrayLike,
        obstacle_states: ArrayLike,
        horizon: int | None,
        render_mode: str | None,
    ) -> None:
        if horizon is not None and horizon < 1:
            raise ValueError(f"horizon: {horizon}, expected a positive number of steps or None")
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            known = self.metadata["render_modes"]
            raise ValueError(f"render_mode: {render_mode!r}, expected None or one of {known}")
        self.model = model
        self.goal_states: Ints = np.asarray(goal_states, dtype=np.intp)
        self.obstacle_states: Ints = np.asarray(obstacle_states, dtype=np.intp)
        self.horizon = horizon
        self.render_mode = render_mode
        self.observation_space = Discrete(model.n_states)
        self.action_space = Discrete(model.n_actions)
        self._state = int(model.start.argmax())
        self._steps = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.int64, dict[str, Any]]:
        super().reset(seed=seed)
        self._state = int(self.np_random.choice(self.model.n_states, p=self.model.start))
        self._steps = 0
        return np.int64(self._state), {}

    def step(self, action: np.int64) -> tuple[np.int64, float, bool, bool, dict[str, Any]]:
        transition = (self._state, int(action))
        branches = self.model.probabilities[transition]
        branch = self.np_random.choice(branches.size, p=branches)
        reward = float(self.model.rewards[transition][branch])
        self._state = int(self.model.successors[transition][branch])
        self._steps += 1
        terminated = bool(self.model.terminal[self._state])
        truncated = self.horizon is not None and self._steps >= self.horizon
        return np.int64(self._state), reward, terminated, truncated, {}

    @abstractmethod
    def render(self) -> Any: ...
