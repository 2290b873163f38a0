"""Mixing Adam's moments along with the parameters: ``optimizer.mix_moments``.

By default an agent's moments stay its own and only parameters are mixed.  With this option they
travel behind the parameters and go through the same rule: moments are mixed with the neighbours',
and what the agent's own gradients changed in them this round is added, as a step is.
"""

from math import prod

import numpy as np

from agent.learning.learner import Attendance, Learner, Step, Vector
from agent.learning.optimizers import MOMENTS


class MixedMoments:
    """A learner whose parameter vector is (theta, first moment, second moment), each (d,).

    Args:
        learner: learns; its optimiser is Adam.
    """

    def __init__(self, learner: Learner) -> None:
        self._learner = learner
        self._size = sum(prod(shape) for _, shape in learner.parts)

    @property
    def parts(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """The learner's own parts, and the moments."""
        return (*self._learner.parts, *((f"adam.{name}", (self._size,)) for name in MOMENTS))

    @property
    def attendance(self) -> Attendance:
        """The learner's."""
        return self._learner.attendance

    @attendance.setter
    def attendance(self, attendance: Attendance) -> None:
        self._learner.attendance = attendance

    @property
    def optimizer_state(self) -> dict[str, Vector]:
        """What does not travel: the number of steps taken."""
        return self._learner.optimizer_state

    def initial(self) -> Vector:
        """The learner's parameters and zero moments."""
        theta = self._learner.initial()
        return np.concatenate([theta, np.zeros(len(MOMENTS) * self._size, theta.dtype)])

    def step(self, theta: Vector, round_: int) -> Step:
        """The learner's step at mixed parameters with mixed moments."""
        own, first, second = np.split(theta, 3)
        state = self._learner.optimizer_state
        # Steps are added to mixed values: a second moment may come out below zero by a hair.
        moments = dict(zip(MOMENTS, (first, np.maximum(second, 0)), strict=True))
        if "count" in state:
            state |= moments
        step = self._learner.step(own, round_)
        changes = [self._learner.optimizer_state[name] - moments[name] for name in MOMENTS]
        return Step(
            np.concatenate([step.vector, *changes]),
            step.value,
            step.episodes,
            step.steps,
            step.gradient_norm,
            step.distance,
        )

    def route(self, theta: Vector) -> tuple[int, ...]:
        """As the learner has it."""
        return self._learner.route(theta[: self._size])

    def close(self) -> None:
        """Close the learner."""
        self._learner.close()
