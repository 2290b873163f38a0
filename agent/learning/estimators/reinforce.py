"""REINFORCE: every-visit Monte-Carlo policy gradient without a baseline (Williams 1992)."""

from typing import Any, ClassVar

from agent.learning.estimators.sampling import Sampling


class Reinforce(
    Sampling, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="reinforce"
):
    """Nothing to set beside what :class:`Sampling` has."""

    epochs: ClassVar[int] = 1

    def weight(self, ratio: Any, gain: Any) -> Any:
        """``w_t = G_t``."""
        return gain
