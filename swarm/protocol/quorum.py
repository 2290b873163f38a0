"""With how few neighbours an agent goes on.  Pure."""

from math import ceil
from typing import Annotated

import msgspec


class Quorum(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When an agent that hears too few neighbours waits, instead of training for itself.

    Attributes:
        minimum: neighbours with which it starts and goes on; by default half of those that it has
            when all are there, rounded up.  0: it may train alone.
        patience: for so long it goes on below that number [s]; then it waits and says so.
    """

    minimum: Annotated[int, msgspec.Meta(ge=0)] | None = None
    patience: Annotated[float, msgspec.Meta(ge=0)] = 30.0

    def of(self, neighbours: int) -> int:
        """How many are needed of so many."""
        return ceil(neighbours / 2) if self.minimum is None else min(self.minimum, neighbours)
