"""So many flights in each of several worlds, whatever the others do.

Counting the first flights that end would favour short ones: a mean safe flight is a mean over the
same number of flights of every world.
"""

from collections.abc import Sequence


class Quota:
    """Which worlds have flights to fly yet.

    Args:
        each: flights of every world.
        most_steps: of a flight.
    """

    def __init__(self, each: Sequence[int], most_steps: int) -> None:
        self._left = list(each)
        self._total, self._most_steps = sum(each), most_steps

    @classmethod
    def split(cls, flights: int, worlds: int, most_steps: int) -> "Quota":
        """`flights` among `worlds`, as evenly as can be."""
        each = [flights // worlds + (i < flights % worlds) for i in range(worlds)]
        return cls(each, most_steps)

    @property
    def flying(self) -> list[int]:
        """Worlds with flights left."""
        return [i for i, count in enumerate(self._left) if count]

    @property
    def ended(self) -> int:
        """Flights that are over."""
        return self._total - sum(self._left)

    def end(self, world: int) -> bool:
        """A flight ended there; whether it counts."""
        counts = self._left[world] > 0
        self._left[world] -= counts
        return counts

    def share(self, steps: Sequence[int]) -> float:
        """How much of all is flown at least, given the steps of the flights under way."""
        partly = sum(min(steps[i] / self._most_steps, 1.0) for i in self.flying)
        return (self.ended + partly) / self._total
