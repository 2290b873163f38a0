"""Robust mixing: equal to plain mixing among friends, unmoved by a poisoner."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.mixing.robust import Robust, shares

WEIGHTS = {"a": 0.1, "b": 0.1, "c": 0.1, "d": 0.1, "e": 0.1}


def differences(seed: int, spread: float = 0.1) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {name: rng.normal(scale=spread, size=20) for name in WEIGHTS}


@given(st.integers(0, 100))
def test_plain_mixing_is_the_weighted_sum(seed: int) -> None:
    deltas = differences(seed)
    added = shares(Robust(), deltas, WEIGHTS)
    for name, delta in deltas.items():
        np.testing.assert_array_equal(added[name], 0.1 * delta)


@given(st.integers(0, 100))
def test_clipping_changes_nothing_within_the_radius_and_bounds_what_is_beyond(seed: int) -> None:
    deltas = differences(seed) | {"e": np.full(20, 1e6)}
    plain = shares(Robust(), deltas, WEIGHTS)
    clipped = shares(Robust(kind="clip", radius=2.0), deltas, WEIGHTS)
    for name in "abcd":
        np.testing.assert_array_equal(clipped[name], plain[name])
    assert np.linalg.norm(clipped["e"]) == pytest.approx(0.1 * 2.0)


def test_trimmed_mean_by_hand() -> None:
    deltas = {"a": np.array([1.0, -5.0]), "b": np.array([2.0, 1.0]), "c": np.array([90.0, 2.0])}
    weights = {"a": 0.2, "b": 0.2, "c": 0.2}
    # With one's own 0: [0 1 2 90] -> 1 and 2 stay; [-5 0 1 2] -> 0 and 1 stay.  Mean of two.
    added = sum(shares(Robust(kind="trimmed-mean"), deltas, weights).values())
    np.testing.assert_allclose(added, 0.6 * np.array([1.5, 0.5]))


@given(st.integers(0, 100), st.floats(-1e6, 1e6))
def test_a_poisoner_stays_within_the_honest_range(seed: int, poison: float) -> None:
    honest = {n: d for n, d in differences(seed).items() if n != "e"}
    deltas = honest | {"e": np.full(20, poison)}
    added = sum(shares(Robust(kind="trimmed-mean"), deltas, WEIGHTS).values())
    reach = np.abs(np.stack(list(honest.values()))).max(axis=0)
    assert (np.abs(added) <= 0.5 * reach + 1e-12).all()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_neighbours_are_trimmed_less(count: int) -> None:
    deltas = {n: np.ones(3) for n in list(WEIGHTS)[:count]}
    added = shares(Robust(kind="trimmed-mean", trim=2), deltas, WEIGHTS)
    assert len(added) == count
    assert all(np.isfinite(share).all() for share in added.values())
