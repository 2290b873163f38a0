"""The exchange of a whole swarm in one process: no network, and every fault at will.

:class:`MemoryExchange` stands where :class:`swarm.exchange.Exchange` stands in a real agent.  What
is lost, late or cut off is a fixed function of seed, round and edge, so that a run with faults can
be repeated; losses are those of :mod:`swarm.mixing.loss`, which real processes apply too.
"""

from collections.abc import Mapping
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarm.mixing.loss import Loss, edge_counts
from swarm.mixing.rules import Missing

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


Attack = Literal["opposite", "noise", "shift"]


class Poison(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Agents that send what is not theirs, within what :class:`swarm.protocol.guard.Guard` lets
    pass.

    Attributes:
        agents: who.
        attack: ``opposite``: their parameters times minus ``strength``; ``noise``: Gaussian numbers
            of that standard deviation; ``shift``: their parameters, ``strength`` added to every
            second one.
        strength: how much.
        first: round in which they begin.
    """

    agents: tuple[str, ...]
    attack: Attack
    strength: float
    first: int = 0

    def spoil(self, round_: int, sender: str, vector: Vector) -> Vector:
        """What the others get in place of ``vector``."""
        if sender not in self.agents or round_ < self.first:
            return vector
        match self.attack:
            case "opposite":
                return -vector.dtype.type(self.strength) * vector
            case "noise":
                rng = np.random.default_rng((round_, self.agents.index(sender)))
                return (self.strength * rng.standard_normal(vector.size)).astype(vector.dtype)
            case "shift":
                moved = vector.copy()
                moved[::2] += vector.dtype.type(self.strength)
                return moved


class Faults(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What goes wrong in a simulated network, beside the losses of the swarm file.

    Attributes:
        delay: every message arrives so many rounds late.
        partitions: edges that carry nothing for a while.
        poison: who sends what he should not.
    """

    delay: int = 0
    partitions: tuple[Partition, ...] = ()
    poison: Poison | None = None


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
        if self._faults.poison is not None:
            vector = self._faults.poison.spoil(round_, sender, vector)
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
