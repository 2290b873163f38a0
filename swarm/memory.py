"""The exchange of a whole swarm in one process: no network, and every fault at will.

:class:`MemoryExchange` stands where :class:`swarm.exchange.Exchange` stands in a real agent.  What
is lost, late or cut off is a fixed function of seed, round and edge, so that a run with faults can
be repeated; losses are those of :mod:`swarm.loss`, which real processes apply too.
"""

from collections.abc import Mapping

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarm.loss import Loss, edge_counts
from swarm.mixing import Missing

Vector = NDArray[np.floating]


class Partition(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A swarm that falls apart for a while.

    Attributes:
        first, last: rounds, both included, in which it lasts.
        groups: agents that hear each other; who is in none of them hears nobody.
    """

    first: int
    last: int
    groups: tuple[tuple[str, ...], ...]

    def cuts(self, round_: int, sender: str, receiver: str) -> bool:
        """Whether a message of this round does not come through."""
        together = any(sender in group and receiver in group for group in self.groups)
        return self.first <= round_ <= self.last and not together


class Faults(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What goes wrong in a simulated network, beside the losses of the swarm file.

    Attributes:
        delay: every message arrives so many rounds late.
        partitions: edges that carry nothing for a while.
    """

    delay: int = 0
    partitions: tuple[Partition, ...] = ()


class MemoryExchange:
    """Everybody's parameters of the last rounds.

    Args:
        neighbours: of each agent.
        loss: messages lost on purpose.
        missing: the mixing's policy; with ``symmetric`` an edge counts in both directions or none.
        faults: what else goes wrong.
    """

    def __init__(
        self,
        neighbours: Mapping[str, tuple[str, ...]],
        loss: Loss,
        missing: Missing,
        faults: Faults | None = None,
    ) -> None:
        self._neighbours, self._loss, self._missing = neighbours, loss, missing
        self._faults = faults or Faults()
        self._sent: dict[int, dict[str, Vector]] = {}

    def publish(self, round_: int, sender: str, vector: Vector) -> None:
        """Send what the receivers will decode."""
        self._sent.setdefault(round_, {})[sender] = vector
        self._sent.pop(round_ - self._faults.delay - 1, None)

    def gather(self, round_: int, receiver: str) -> dict[str, Vector]:
        """What has arrived by this round and counts, by sender."""
        written = round_ - self._faults.delay
        sent = self._sent.get(written, {})
        return {
            sender: sent[sender]
            for sender in self._neighbours[receiver]
            if sender in sent
            and edge_counts(self._loss, self._missing, written, sender, receiver)
            and not any(p.cuts(written, sender, receiver) for p in self._faults.partitions)
        }
