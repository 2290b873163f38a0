"""PPO: several clipped steps from the same episodes (Schulman et al. 2017, the clipped form)."""

from typing import Annotated, Any

import msgspec


class PPO(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="ppo"):
    """Attributes:
    gamma: discount factor.
    entropy_weight: lambda of the relative-entropy regulariser.
    episodes: episodes per round.
    horizon: most steps of an episode; where it cuts, the critic says what was to come.
    discount_visits: weigh step t by gamma^t, as Eq. 9 does.
    trace: the lambda of GAE; see :class:`~agent.estimators.a2c.A2C`.
    value_weight: of the critic's squared error beside the policy's objective.
    clip: how far the ratio may go from 1 while there is more to gain.
    epochs: optimiser steps from the same episodes; their sum is the round's step.
    """

    gamma: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.99
    entropy_weight: Annotated[float, msgspec.Meta(ge=0)] = 0.03
    episodes: Annotated[int, msgspec.Meta(ge=1)] = 1
    horizon: Annotated[int, msgspec.Meta(ge=1)] = 200
    discount_visits: bool = False
    trace: Annotated[float, msgspec.Meta(ge=0, le=1)] = 1.0
    value_weight: Annotated[float, msgspec.Meta(ge=0)] = 0.5
    clip: Annotated[float, msgspec.Meta(gt=0)] = 0.2
    epochs: Annotated[int, msgspec.Meta(ge=1)] = 4

    def weight(self, ratio: Any, gain: Any) -> Any:
        """``w_t = rho_t A_t``, or 0 where ``min(rho A, clip(rho) A)`` is flat in rho."""
        not_clipped = (ratio - 1.0) * gain <= self.clip * abs(gain)
        return not_clipped * ratio * gain
