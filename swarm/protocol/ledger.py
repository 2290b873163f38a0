"""What an agent mixed in lately, set beside what its neighbours say they did.

W must be symmetric on what was really exchanged, or the swarm's mean drifts.  Each header repeats
the weights its sender used in its last rounds, so both ends of an edge can compare: an edge that
only one end used is *one-sided*.  With ``missing = "symmetric"`` the end that used it takes its
share back.  Pure bookkeeping; nothing here waits or sends.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from swarm.wire.payload import ParameterHeader

Vector = NDArray[np.floating]
REPEATED = 3  # rounds that a header tells of, and that can be put right
TOLERANCE = 1e-9  # between the two weights of one edge


@dataclass(slots=True)
class Ledger:
    """The account of one agent.

    Attributes:
        me: the agent's id.
        used: weight by neighbour of the last :data:`REPEATED` rounds, those that count.
        shares: what each neighbour added to the mean in those rounds.
        one_sided: edges found one-sided so far, as a count.
    """

    me: str
    used: dict[int, dict[str, float]] = field(default_factory=dict)
    shares: dict[int, dict[str, Vector]] = field(default_factory=dict)
    one_sided: int = 0

    def record(
        self, round_: int, weights: Mapping[str, float], shares: Mapping[str, Vector]
    ) -> None:
        """Keep what this round used; forget what is too old to be put right."""
        self.used[round_], self.shares[round_] = dict(weights), dict(shares)
        for old in sorted(self.used)[:-REPEATED]:
            del self.used[old], self.shares[old]

    def declined(self, round_: int, newer: Iterable[ParameterHeader]) -> set[str]:
        """Neighbours that have gone on and say that they did without us in this round."""
        return {
            header.agent
            for header in newer
            if header.round > round_ and self.me not in header.used.get(round_, {self.me: 0.0})
        }

    def settle(self, headers: Iterable[ParameterHeader]) -> list[Vector]:
        """Compare the neighbours' accounts with ours; shares that were one-sided, each once."""
        owed: list[Vector] = []
        for header in headers:
            for round_, theirs in header.used.items():
                ours = self.used.get(round_, {})
                if header.agent not in ours:
                    continue
                if abs(theirs.get(self.me, 0.0) - ours[header.agent]) <= TOLERANCE:
                    continue
                self.one_sided += 1
                del ours[header.agent]
                share = self.shares[round_].pop(header.agent, None)
                if self.me not in theirs and share is not None:
                    owed.append(share)
        return owed
