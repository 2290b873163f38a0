"""Agents of any speeds learn as much as each other, and nobody runs away."""

from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.mixing.staleness import CATCH_UP, share_to_learn

BOUND = 16.0


@pytest.mark.parametrize(
    ("own", "neighbours", "share"),
    [
        (5.0, [], 1.0),  # alone
        (5.0, [5.0, 5.0], 1.0),
        (5.0, [6.5, 7.5], 2.5),  # behind: as much as it lacks
        (5.0, [40.0, 5.0], CATCH_UP),  # but no more than this
        (13.0, [5.0, 13.0], 1.0),  # half the bound ahead
        (17.0, [5.0, 17.0], 0.5),
        (21.0, [5.0, 90.0], 0.0),  # the whole, whoever else is farther
        (90.0, [5.0, 17.0], 0.0),
    ],
)
def test_who_is_ahead_learns_less_and_who_is_behind_more(
    own: float, neighbours: list[float], share: float
) -> None:
    assert share_to_learn(own, neighbours, BOUND) == share


@settings(deadline=None)
@given(st.lists(st.floats(0.02, 1.0), min_size=2, max_size=8), st.integers(0, 2**32))
def test_nobody_gets_farther_ahead_of_a_neighbour_than_the_bound(
    speeds: list[float], seed: int
) -> None:
    learned = [0.0] * len(speeds)
    for i in Random(seed).choices(range(len(speeds)), speeds, k=1000):
        nearby = [learned[i - 1], learned[(i + 1) % len(speeds)]]
        learned[i] += share_to_learn(learned[i], nearby, BOUND)
        assert learned[i] - min(nearby) <= BOUND + CATCH_UP
