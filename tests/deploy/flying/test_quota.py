"""Every world flies the same number of flights, and the share of them that is flown only grows."""

import pytest

from deploy.flying.quota import Quota


def test_flights_are_split_evenly_and_none_is_lost() -> None:
    quota = Quota.split(8, 3, most_steps=100)
    counted = []
    while quota.flying:
        counted += [world for world in range(3) if quota.end(world)]
    assert sorted(counted) == [0, 0, 0, 1, 1, 1, 2, 2] and quota.ended == 8


def test_a_world_that_has_flown_all_counts_no_more() -> None:
    quota = Quota([1, 2], most_steps=100)
    assert quota.end(0) and not quota.end(0)
    assert quota.flying == [1]


def test_flights_under_way_count_by_their_steps() -> None:
    quota = Quota([2, 2], most_steps=100)
    assert quota.share([50, 0]) == pytest.approx(0.5 / 4)
    quota.end(0)
    assert quota.share([0, 100]) == pytest.approx(2 / 4)
    for world in (0, 1, 1):
        quota.end(world)
    assert quota.share([70, 70]) == 1.0
