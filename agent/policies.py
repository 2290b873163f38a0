"""What is learned: the policy's settings, its layout as one flat vector, and its derivatives."""

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarm.payload import Precision

Table = NDArray[np.float64]


class Tabular(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="tabular"
):
    """Softmax over a table of logits theta[s, a] (Eq. 5), zero at first: uniform.

    Attributes:
        precision: type of the parameters in memory and on the wire.
    """

    precision: Precision = "float32"


Policy = Tabular


def softmax(logits: NDArray[np.floating]) -> Table:
    """Rows of probabilities (S, A), in float64 whatever the parameters' type."""
    wide = np.asarray(logits, np.float64)
    weights = np.exp(wide - wide.max(axis=-1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def score_sum(
    policy: Table,
    states: NDArray[np.intp],
    actions: NDArray[np.intp],
    weights: NDArray[np.float64],
) -> Table:
    """``sum_t w_t grad log pi(a_t | s_t)`` with respect to the logits.

    Args:
        policy: (S, A) probabilities at which the steps were sampled.
        states, actions, weights: (n,) the steps; added up in this order.

    Returns:
        (S, A), from ``d log pi(a'|s') / d theta[s, a] = 1[s'=s] (1[a'=a] - pi(a|s))``.
    """
    n_states, n_actions = policy.shape
    taken = np.bincount(states * n_actions + actions, weights, n_states * n_actions)
    taken = taken.reshape(n_states, n_actions)
    return np.asarray(taken - policy * taken.sum(axis=1, keepdims=True))


def entropy_gradient(policy: Table) -> Table:
    """Gradient of ``-RE(pi)`` with respect to the logits: ``(1/|A| - pi) / |S|`` (Eq. 9)."""
    n_states, n_actions = policy.shape
    return np.asarray((1.0 / n_actions - policy) / n_states)
