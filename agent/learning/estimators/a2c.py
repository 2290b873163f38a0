"""A2C: advantages from a critic instead of returns (Mnih 2016), by GAE (Schulman 2016)."""

from typing import Any, ClassVar

from agent.learning.estimators.sampling import Sampling, Unit, Weight


class A2C(Sampling, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="a2c"):
    """Attributes beside those of :class:`Sampling`; where the horizon cuts, the critic goes on:

    trace: the lambda of GAE; 1 uses the critic as a baseline only, so that a wrong critic does no
        harm.  Smaller values have less variance; choose them where the critic is to be trusted.
    value_weight: of the critic's squared error beside the policy's objective.
    mix_critic: the value head travels and is mixed as all parameters are.  Mixed over tasks that
        look alike, it speaks for their mean and is wrong for each.  False: every agent keeps a head
        of its own, on the trunk that is mixed.
    """

    epochs: ClassVar[int] = 1

    trace: Unit = 1.0
    value_weight: Weight = 0.5
    mix_critic: bool = True

    def weight(self, ratio: Any, gain: Any) -> Any:
        """``w_t = A_t``."""
        return gain
