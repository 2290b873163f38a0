"""The exact gradient of the regularised objective (Eq. 9), for tasks whose model is known."""

from typing import Annotated

import msgspec


class Exact(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="exact"):
    """Attributes:
    gamma: discount factor.
    entropy_weight: lambda of the relative-entropy regulariser.
    """

    gamma: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.99
    entropy_weight: Annotated[float, msgspec.Meta(ge=0)] = 0.03
