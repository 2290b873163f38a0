"""A2C: advantages from a critic instead of returns (Mnih 2016), by GAE (Schulman 2016)."""

from typing import Any, ClassVar

from agent.estimators.sampling import Sampling, Unit, Weight


class A2C(Sampling, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="a2c"):
    """Attributes beside those of :class:`Sampling`; where the horizon cuts, the critic goes on:

    trace: the lambda of GAE; 1 uses the critic as a baseline only, so that a wrong critic does no
        harm, and a swarm's is wrong: mixed over tasks, it speaks for their mean.  Smaller values
        have less variance; choose them where the observation tells the tasks apart.
    value_weight: of the critic's squared error beside the policy's objective.
    """

    epochs: ClassVar[int] = 1

    trace: Unit = 1.0
    value_weight: Weight = 0.5

    def weight(self, ratio: Any, gain: Any) -> Any:
        """``w_t = A_t``."""
        return gain
