"""What every estimator that flies episodes has to know."""

from typing import Annotated

import msgspec

Unit = Annotated[float, msgspec.Meta(ge=0, le=1)]
Weight = Annotated[float, msgspec.Meta(ge=0)]
Count = Annotated[int, msgspec.Meta(ge=1)]


class Sampling(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Attributes:
    gamma: discount factor.
    entropy_weight: lambda of the relative-entropy regulariser.
    episodes: episodes per round.
    horizon: most steps of an episode.
    discount_visits: weigh step t by gamma^t, as Eq. 9 does; practice, and the paper's
        experiments, leave it out.
    """

    gamma: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.99
    entropy_weight: Weight = 0.03
    episodes: Count = 1
    horizon: Count = 200
    discount_visits: bool = False
