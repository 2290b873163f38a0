"""What the paper says of the consensus error, to be drawn beside the measured one.

Lemma 2: with weights of second largest singular value ``sigma``, equal starts or not,

    error(k)  <=  sigma^k error(0)  +  alpha D / (1 - sigma)

``D`` bounds the norm of all agents' gradients together; here it is the largest seen so far, agent
by agent.  The bound is drawn where the lemma holds, for the rule ``dcpg`` with plain gradient
ascent, unless it is more than :data:`FAR` times the largest error so far, and would press the
measured lines flat.  The decay is drawn always.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from agent.config.experiment import SwarmFile
from agent.learning.optimizers import Sgd
from deploy.viewer.moments import Moment, errors
from deploy.viewer.rows import Row, scalars
from swarm.mixing.weights import graph, spectrum, weight_matrix

FAR = 100.0  # times the largest error so far
DECAY, BOUND = "consensus_error/decay", "consensus_error/bound"


@dataclass(slots=True)
class Theory:
    """Of one swarm, as it goes.

    Attributes:
        gap: ``1 - sigma`` of the full topology.
        step: ``alpha``; None where the lemma does not hold.
        start: round and largest error of the first moment that had one.
        norms: largest gradient of each agent so far.
        most: largest error so far.
    """

    gap: float
    step: float | None
    start: tuple[int, float] | None = None
    norms: dict[str, float] = field(default_factory=dict)
    most: float = 0.0

    @classmethod
    def of(cls, config: SwarmFile) -> Self:
        """The theory of a swarm, before its first moment."""
        W = weight_matrix(graph(config.topology, config.members), config.members)
        gap = spectrum(W).gap
        holds = config.mixing.rule == "dcpg" and isinstance(config.optimizer, Sgd)
        return cls(gap, config.optimizer.step if holds else None)

    def rows(self, now: Moment) -> Iterator[Row]:
        """Its two curves at this moment, where the error itself is known."""
        for agent, report in now.reports.items():
            self.norms[agent] = max(self.norms.get(agent, 0.0), report.gradient_norm)
        largest = max(errors(now).values(), default=0.0)
        if largest == 0.0:
            return
        self.most = max(self.most, largest)
        if self.start is None or now.round < self.start[0]:
            self.start = now.round, largest
        first, error = self.start
        at = (now.round, now.time)
        yield Row(DECAY, scalars, *at, error * (1 - self.gap) ** (now.round - first))
        if self.step is not None and self.gap > 0:
            together = float(np.linalg.norm(list(self.norms.values())))
            bound = self.step * together / self.gap
            if bound <= FAR * self.most:
                yield Row(BOUND, scalars, *at, bound)
