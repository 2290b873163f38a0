"""PPO: several clipped steps from the same episodes (Schulman et al. 2017, the clipped form)."""

from typing import Annotated, Any

import msgspec

from agent.learning.estimators.sampling import Count, Sampling, Unit, Weight


class PPO(Sampling, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="ppo"):
    """Attributes beside those of :class:`Sampling`:

    trace, value_weight, mix_critic: see :class:`~agent.learning.estimators.a2c.A2C`.
    clip: how far the ratio may go from 1 while there is more to gain.
    epochs: optimiser steps from the same episodes; their sum is the round's step.
    """

    trace: Unit = 1.0
    value_weight: Weight = 0.5
    mix_critic: bool = True
    clip: Annotated[float, msgspec.Meta(gt=0)] = 0.2
    epochs: Count = 4

    def weight(self, ratio: Any, gain: Any) -> Any:
        """``w_t = rho_t A_t``, or 0 where ``min(rho A, clip(rho) A)`` is flat in rho."""
        not_clipped = (ratio - 1.0) * gain <= self.clip * abs(gain)
        return not_clipped * ratio * gain
