"""Consensus error, exactly and from sketches."""

import numpy as np
import pytest

from swarm.mixing.consensus import SKETCH, consensus_errors, disagreement, sketch, sketch_errors


def test_by_hand() -> None:
    np.testing.assert_allclose(consensus_errors(np.array([[0.0, 0.0], [6.0, 8.0]])), [5.0, 5.0])
    assert disagreement(np.zeros(2), [np.array([3.0, 4.0]), np.array([1.0, 0.0])]) == 5.0
    assert disagreement(np.zeros(2), []) == 0.0


def test_sketches_of_short_vectors_are_exact() -> None:
    theta = np.random.default_rng(0).normal(size=SKETCH).astype(np.float32)
    np.testing.assert_array_equal(sketch(theta), theta)


@pytest.mark.statistical
@pytest.mark.parametrize("size", [400, 50_000])
def test_sketches_of_long_vectors_keep_distances(size: int) -> None:
    rng = np.random.default_rng(1)
    vectors = rng.normal(size=(6, size))
    exact = consensus_errors(vectors)
    seen = sketch_errors({str(i): sketch(v).tolist() for i, v in enumerate(vectors)})
    np.testing.assert_allclose(list(seen.values()), exact, rtol=0.3)  # 3 standard deviations


def test_sketches_of_different_swarms_are_not_compared() -> None:
    assert sketch_errors({"a": [1.0], "b": [1.0, 2.0]}) == {}
    assert sketch_errors({}) == {}
