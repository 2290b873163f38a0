"""Many agents on a small screen: how ids and numbers of a crowd are said in a few words."""

from collections.abc import Sequence
from statistics import median

import numpy as np

MANY = 8  # agents from which on a crowd is summed up; fewer are shown one by one
NAMED = 4  # ids of a longer list that are spelt out
LEAST = 3  # rows that even the lowest screen shows


def named(agents: Sequence[str], most: int = NAMED) -> str:
    """``drone0, drone1, drone2, drone3 and 60 more``."""
    if len(agents) <= most + 1:  # "and 1 more" would be no shorter
        return ", ".join(agents)
    return f"{', '.join(agents[:most])} and {len(agents) - most} more"


def spread(values: Sequence[float], form: str = "+.2f") -> str:
    """``-0.20 to +0.90, median +0.51``; of one value, itself."""
    if not values:
        return "-"
    low, high = (format(end, form) for end in (min(values), max(values)))
    return low if low == high else f"{low} to {high}, median {median(values):{form}}"


def rounds(reached: Sequence[float], of: int) -> str:
    """``310 to 312/1000``; where all are in one round, ``312/1000``."""
    low, high = f"{min(reached):.0f}", f"{max(reached):.0f}"
    return f"{low}/{of}" if low == high else f"{low} to {high}/{of}"


def shown(agents: int, height: int, beside: int) -> int:
    """How many rows of a table a screen has room for.

    Args:
        agents: rows that there are.
        height: of the screen [lines].
        beside: lines that are needed for all else.
    """
    return int(np.clip(height - beside, min(LEAST, agents), agents))
