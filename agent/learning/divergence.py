"""When learning has left all numbers, or all sense: the run says so and ends.

Interface: :func:`check`, after every round and before anything of it is kept or told, in the agent
and in the simulator alike.  So checkpoints and neighbours only ever get parameters to go on from,
and whoever would rather go back than end catches :class:`agent.errors.DivergenceError` there.
"""

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.errors import DivergenceError
from agent.learning.policies import Policy, Tabular

# Logits of a table so far from 0 make probabilities of exactly 0 and 1 (exp(-745) is 0 in double
# precision, exp(-104) in single): the gradient is 0 from then on, and nothing is learned any more.
LARGEST_LOGIT = 1e3
# Weights of a network are of the order of 1; beyond this single precision does not resolve what an
# ordinary step adds.  A guess, on the safe side.
LARGEST_WEIGHT = 1e6


@dataclass(frozen=True, slots=True)
class Bound:
    """How large parameters may grow.

    Attributes:
        count: so many of them, from the first on; a table's critic follows and may be any size.
        largest: absolute value.
        what: their name.
    """

    count: int
    largest: float
    what: str


def bound_of(policy: Policy, parts: tuple[tuple[str, tuple[int, ...]], ...]) -> Bound:
    """The bound of a policy, given the names and shapes of its parameters."""
    if isinstance(policy, Tabular):
        return Bound(prod(parts[0][1]), LARGEST_LOGIT, "logit")
    return Bound(sum(prod(shape) for _, shape in parts), LARGEST_WEIGHT, "weight")


def check(
    round_: int, bound: Bound, theta: NDArray[np.floating], numbers: dict[str, Any], who: str = ""
) -> None:
    """See that a round left something to go on from.

    Args:
        round_: its number.
        bound: of the parameters.
        theta: (*B, d) the new parameters of one agent or of many.
        numbers: what else must be finite, by name.
        who: whose, for the message.

    Raises:
        DivergenceError: names the round and the cause.
    """
    where = f"{who}: diverged in round {round_}" if who else f"diverged in round {round_}"
    for name, value in numbers.items():
        if not np.isfinite(value).all():
            raise DivergenceError(f"{where}: the {name} is {value}; expected a smaller step")
    if not np.isfinite(theta).all():
        raise DivergenceError(f"{where}: parameters are not finite; expected a smaller step")
    largest = float(np.abs(theta[..., : bound.count]).max())
    if largest > bound.largest:
        raise DivergenceError(
            f"{where}: a {bound.what} of {largest:.2g}, expected {bound.largest:g} at most: "
            "probabilities are 0 or 1 there and nothing is learned; expected a smaller step"
        )
