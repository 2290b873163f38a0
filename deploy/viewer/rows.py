"""One value of one entity at one time: what everything that is drawn is made of."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import rerun as rr

Columns = list[rr.ComponentColumn]


class Row(NamedTuple):
    """One value of an entity; ``draw`` turns a list of such values into columns."""

    path: str
    draw: Callable[[Sequence[Any]], Columns]
    round: int
    time: float
    value: Any


def scalars(values: Sequence[float]) -> Columns:
    """A number a row."""
    return [*rr.Scalars.columns(scalars=values)]
