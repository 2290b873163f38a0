"""How far the agents are from agreeing, measured exactly or from small sketches.

The consensus error of agent i is ``||theta_i - mean_j theta_j||``; Lemma 2 of the paper bounds it
by ``alpha D / (1 - sigma_2)``.  Nobody in a swarm holds all parameters, so each agent publishes a
count sketch of its own (Charikar et al. 2002): every parameter is added with a fixed random sign to
one of :data:`SKETCH` buckets.  Sketches are linear, so an observer can average and subtract them;
the norm of a difference is right to about ``sqrt(2 / SKETCH)`` = 9%, exact for vectors that fit.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.floating]
SKETCH = 256


@lru_cache(maxsize=4)
def _hashes(size: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    rng = np.random.default_rng(size)
    return rng.integers(0, SKETCH, size), rng.choice([-1.0, 1.0], size)


def sketch(theta: Vector) -> NDArray[np.float32]:
    """At most :data:`SKETCH` numbers whose distances are (nearly) the distances of the vectors."""
    if theta.size <= SKETCH:
        return theta.astype(np.float32)
    bucket, sign = _hashes(theta.size)
    return np.bincount(bucket, sign * theta, SKETCH).astype(np.float32)


def consensus_errors(vectors: NDArray[np.floating]) -> NDArray[np.float64]:
    """``||v_i - mean v||`` for each row of ``vectors`` (N, d), parameters or sketches."""
    wide = np.asarray(vectors, np.float64)
    return np.asarray(np.linalg.norm(wide - wide.mean(axis=0), axis=1))


def sketch_errors(sketches: Mapping[str, Sequence[float]]) -> dict[str, float]:
    """Consensus error of each agent from its sketch; empty unless all are of one length."""
    given = {agent: sketch for agent, sketch in sketches.items() if len(sketch)}
    if len({len(sketch) for sketch in given.values()}) != 1:
        return {}
    errors = consensus_errors(np.array(list(given.values())))
    return dict(zip(given, errors.tolist(), strict=True))


def disagreement(theta: Vector, others: list[Vector]) -> float:
    """Largest distance to a neighbour: what one agent can say by itself."""
    return max((float(np.linalg.norm(theta - other)) for other in others), default=0.0)
