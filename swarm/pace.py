"""Equal say for agents of unequal speed, in a swarm that does not wait.

Agents of an asynchronous swarm mix a message once, so per second an edge pulls as hard at one end
as at the other and everybody's parameters weigh the same.  Their steps do not: who plays five
rounds while another plays one takes five steps for its own task to the other's one.  The sum of all
tasks is climbed again when each step is as long as its round: ``alpha_i = alpha d_i / d``, with
``d_i`` an agent's own time a round and ``d`` the swarm's geometric mean, on which neighbours agree
by averaging (headers carry it).  In a swarm of equal speed that is ``alpha``.

Staleness is bounded: beyond :data:`LEAD` rounds for one of a neighbour's, an agent waits for it.

Source: the averaging analysis of asynchronous stochastic approximation (Borkar 2008, ch. 7), where
a component counts as often as it is updated; leaky dynamic average consensus (Kia et al. 2019).
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import exp, log

WINDOW = 64  # rounds that a duration is the mean of; a stop-and-go agent needs some
LEAK = 0.05  # weight of the own duration in the agreed one, a round; a guess
LONGEST = 10.0  # times alpha, and one over it; a guess
LEAD = 8  # rounds to a neighbour's one before it is waited for
START = 64  # rounds by which one may be ahead at any time


@dataclass(slots=True)
class Pace:
    """One agent's measure of its own speed and of the swarm's.

    Attributes:
        usual: the swarm's mean duration of a round, as far as this agent knows [s]; 0 at first.
        ends: when the last rounds ended [s].
    """

    usual: float = 0.0
    ends: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW + 1))

    def lap(self, now: float, neighbours: Iterable[float]) -> float:
        """How much longer than ``alpha`` the step of the round that ends now should be.

        Args:
            now: monotonic time [s].
            neighbours: what they take for usual, from their newest headers [s].
        """
        self.ends.append(now)
        own = (now - self.ends[0]) / max(1, len(self.ends) - 1)
        if own <= 0.0:
            return 1.0
        told = [log(pace) for pace in (self.usual, *neighbours) if pace > 0.0]
        if told:
            self.usual = exp((1 - LEAK) * sum(told) / len(told) + LEAK * log(own))
        else:
            self.usual = own
        return min(max(own / self.usual, 1 / LONGEST), LONGEST)


def left_behind(round_: int, rounds: Mapping[str, int]) -> set[str]:
    """Neighbours, by the newest round heard from them, that are too far behind to go on without."""
    return {agent for agent, theirs in rounds.items() if round_ > LEAD * theirs + START}
