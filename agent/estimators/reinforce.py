"""REINFORCE: every-visit Monte-Carlo policy gradient without a baseline (Williams 1992)."""

from typing import Annotated

import msgspec


class Reinforce(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="reinforce"
):
    """Attributes:
    gamma: discount factor.
    entropy_weight: lambda of the relative-entropy regulariser.
    episodes: episodes per round.
    horizon: most steps of an episode.
    discount_visits: weigh step t by gamma^t, as Eq. 9 does; practice, and the paper's
        experiments, leave it out.
    """

    gamma: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.99
    entropy_weight: Annotated[float, msgspec.Meta(ge=0)] = 0.03
    episodes: Annotated[int, msgspec.Meta(ge=1)] = 1
    horizon: Annotated[int, msgspec.Meta(ge=1)] = 200
    discount_visits: bool = False
