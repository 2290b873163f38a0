"""What is learned: the settings of every kind of policy, and the derivatives of the tabular one.

The networks themselves stand in :mod:`agent.learning.networks`, because they need torch.
"""

from math import prod
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarm.wire.payload import Precision

Table = NDArray[np.float64]


class Tabular(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="tabular"
):
    """Softmax over a table of logits theta[s, a] (Eq. 5), zero at first: uniform.

    Attributes:
        precision: type of the parameters in memory and on the wire.
    """

    precision: Precision = "float32"


class Network(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="network"
):
    """Softmax over a network's logits, for any Gymnasium task with discrete actions.

    Fully connected with tanh where observations are vectors; three convolutions (Mnih et al. 2015)
    and one hidden layer where they are pictures.

    Attributes:
        hidden: width of each fully connected hidden layer.
        compute: type of the arithmetic; ``auto`` is bfloat16 for pictures on a CPU that has
            instructions for it, else float32.  Parameters are float32 in any case.
        device: where it runs, ``cpu`` or ``cuda``.
    """

    hidden: tuple[Annotated[int, msgspec.Meta(ge=1)], ...] = (64, 64)
    compute: Literal["auto", "float32", "bfloat16"] = "auto"
    device: Literal["cpu", "cuda"] = "cpu"

    @property
    def precision(self) -> Precision:
        """Type of the parameters on the wire."""
        return "float32"


class C3F2(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="c3f2"):
    """The network of the paper's drone experiment (notes to the paper; Anwar and Raychowdhury).

    Attributes:
        compute, device: see :class:`Network`.
    """

    compute: Literal["auto", "float32", "bfloat16"] = "auto"
    device: Literal["cpu", "cuda"] = "cpu"

    @property
    def precision(self) -> Precision:
        """Type of the parameters on the wire."""
        return "float32"


Neural = Network | C3F2
Policy = Tabular | Neural


def softmax(logits: NDArray[np.floating]) -> Table:
    """Rows of probabilities (..., A), in float64 whatever the parameters' type."""
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
        policy: (*B, S, A) probabilities of one agent (B empty) or of many at once.
        states, actions: (T, *B, E) the steps; added up in this order, so that an agent gets the
            same bits alone and among others.
        weights: (T, *B, E), 0 for steps that were not taken.

    Returns:
        (*B, S, A), from ``d log pi(a'|s') / d theta[s, a] = 1[s'=s] (1[a'=a] - pi(a|s))``.
    """
    cells = table_rows(policy.shape[:-1], states) * policy.shape[-1] + actions
    taken = np.bincount(cells.ravel(), weights.ravel(), policy.size).reshape(policy.shape)
    return np.asarray(taken - policy * taken.sum(axis=-1, keepdims=True))


def table_rows(shape: tuple[int, ...], states: NDArray[np.intp]) -> NDArray[np.intp]:
    """Where the ``states`` (T, *B, E) of each agent stand in a flat table of ``shape`` (*B, S)."""
    first = np.arange(prod(shape[:-1])).reshape(*shape[:-1], 1) * shape[-1]
    return np.asarray(first + states)


def entropy_gradient(policy: Table) -> Table:
    """Gradient (*B, S, A) of ``-RE(pi)`` for the logits: ``(1/|A| - pi) / |S|`` (Eq. 9)."""
    n_states, n_actions = policy.shape[-2:]
    return np.asarray((1.0 / n_actions - policy) / n_states)
