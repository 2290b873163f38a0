"""What a learner is to a round: parameters in, step out.

A learner owns the world, the estimator and the optimiser of one agent.  It is a pure function of
(parameters, round, seed) except for the optimiser's moments, which a checkpoint keeps.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class Step:
    """What one round of learning gave.

    Attributes:
        vector: (d,) the optimiser's step, to be added to the mixed parameters.
        value: mean discounted return of the episodes (exact estimator: the exact value).
        episodes, steps: flown in this round.
        gradient_norm: Euclidean norm of the gradient estimate.
        distance: mean length of the flights that ended [m], where the world tells it.
    """

    vector: Vector
    value: float
    episodes: int
    steps: int
    gradient_norm: float
    distance: float | None = None


@dataclass(frozen=True, slots=True)
class Moment:
    """One step of the world that an agent shows to others.

    Attributes:
        env: the world.
        flight, step: numbers, from 0; of the flight, and of the step in it.
        action, reward: what was done, and what it gave.
        observation: after it.
        info: what the world said beside.
    """

    env: gymnasium.Env[Any, Any]
    flight: int
    step: int
    action: int
    reward: float
    observation: NDArray[Any]
    info: dict[str, Any]


class Stopped(Exception):  # noqa: N818  (no error: somebody asked for it)
    """A round was given up because the agent is to end."""


@dataclass(slots=True)
class Attendance:
    """Who looks on while a learner learns.

    Attributes:
        stopped: whether the round under way should be given up.
        see: shown every step of the agent's first world.
    """

    stopped: Callable[[], bool] = lambda: False
    see: Callable[[Moment], None] = lambda moment: None


class Learner(Protocol):
    """One agent's learning.

    Attributes:
        attendance: who looks on; whoever runs the learner may change it.
    """

    attendance: Attendance

    @property
    def parts(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Names and shapes of the tensors that make up the parameter vector."""
        ...

    @property
    def optimizer_state(self) -> dict[str, Vector]:
        """What the optimiser remembers, and a critic of the agent's own; kept in checkpoints."""
        ...

    def initial(self) -> Vector:
        """Parameters at the start of the first round, the same for every agent."""
        ...

    def step(self, theta: Vector, round_: int) -> Step:
        """Estimate the gradient at ``theta`` and turn it into a step.

        Raises:
            Stopped: somebody in attendance said so; nothing is remembered of the round.
        """
        ...

    def route(self, theta: Vector) -> tuple[int, ...]:
        """States on the path most followed under ``theta``; empty where there is none."""
        ...

    def close(self) -> None:
        """Let go of the worlds."""
        ...
