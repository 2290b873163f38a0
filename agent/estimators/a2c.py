"""A2C: advantages from a critic instead of returns (Mnih 2016), by GAE (Schulman 2016)."""

from typing import Annotated, Any, ClassVar

import msgspec


class A2C(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="a2c"):
    """Attributes:
    gamma: discount factor.
    entropy_weight: lambda of the relative-entropy regulariser.
    episodes: episodes per round.
    horizon: most steps of an episode; where it cuts, the critic says what was to come.
    discount_visits: weigh step t by gamma^t, as Eq. 9 does.
    trace: the lambda of GAE; 1 uses the critic as a baseline only, so that a wrong critic does no
        harm, and a swarm's is wrong: mixed over tasks, it speaks for their mean.  Smaller values
        have less variance; choose them where the observation tells the tasks apart.
    value_weight: of the critic's squared error beside the policy's objective.
    """

    epochs: ClassVar[int] = 1

    gamma: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.99
    entropy_weight: Annotated[float, msgspec.Meta(ge=0)] = 0.03
    episodes: Annotated[int, msgspec.Meta(ge=1)] = 1
    horizon: Annotated[int, msgspec.Meta(ge=1)] = 200
    discount_visits: bool = False
    trace: Annotated[float, msgspec.Meta(ge=0, le=1)] = 1.0
    value_weight: Annotated[float, msgspec.Meta(ge=0)] = 0.5

    def weight(self, ratio: Any, gain: Any) -> Any:
        """``w_t = A_t``."""
        return gain
