"""Graphs and weights: Assumption 1 for every rule, eigenvalues known by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.errors import ConfigError
from swarm.mixing.weights import (
    Kind,
    Topology,
    check,
    graph,
    lazy_metropolis,
    neighbours,
    spectrum,
    weight_matrix,
)

KINDS: list[Kind] = [
    "ring", "path", "grid", "complete", "star", "exponential", "random-geometric",
]  # fmt: skip


def members(n: int) -> tuple[str, ...]:
    return tuple(f"d{i:02d}" for i in range(n))


@given(st.sampled_from(KINDS), st.integers(1, 20), st.integers(0, 3))
def test_weights_are_symmetric_doubly_stochastic_and_positive(
    kind: Kind, n: int, seed: int
) -> None:
    topology = Topology(kind=kind, radius=0.6, seed=seed)
    W = weight_matrix(graph(topology, members(n)), members(n))
    assert np.array_equal(W, W.T)
    np.testing.assert_allclose(W.sum(axis=0), 1.0, atol=1e-12)
    assert (np.diag(W) >= 0.5 - 1e-12).all()  # lazy: at least half stays
    assert np.linalg.eigvalsh(W)[0] >= -1e-12  # positive semidefinite


@given(st.sampled_from(KINDS), st.integers(2, 12))
def test_every_agent_computes_its_row_of_w_by_itself(kind: Kind, n: int) -> None:
    topology, ids = Topology(kind=kind, radius=0.6), members(n)
    W = weight_matrix(graph(topology, ids), ids)
    degree = {m: len(neighbours(topology, ids, m)) for m in ids}
    for i, me in enumerate(ids):
        for other in neighbours(topology, ids, me):
            assert W[i, ids.index(other)] == lazy_metropolis(degree[me], degree[other])


def test_small_rings_by_hand() -> None:
    pair = weight_matrix(graph(Topology(), members(2)), members(2))
    np.testing.assert_array_equal(pair, [[0.5, 0.5], [0.5, 0.5]])
    three = weight_matrix(graph(Topology(), members(3)), members(3))
    np.testing.assert_array_equal(three, [[0.5, 0.25, 0.25], [0.25, 0.5, 0.25], [0.25, 0.25, 0.5]])


@pytest.mark.parametrize("n", [3, 4, 7, 16, 64])
def test_second_eigenvalue_of_a_ring(n: int) -> None:
    values = spectrum(weight_matrix(graph(Topology(), members(n)), members(n)))
    assert values.second == pytest.approx(0.5 + 0.5 * np.cos(2 * np.pi / n), abs=1e-12)
    assert values.gap == pytest.approx(1 - values.second)


def test_a_ring_closes_over_the_members_that_are_present() -> None:
    assert neighbours(Topology(), ("a", "b", "c", "d"), "a") == ("b", "d")
    assert neighbours(Topology(), ("a", "b", "d"), "a") == ("b", "d")
    assert neighbours(Topology(), ("a", "b"), "a") == ("b",)
    assert neighbours(Topology(), ("a",), "a") == ()
    assert neighbours(Topology(), ("b", "c"), "a") == ()


@pytest.mark.parametrize(
    ("topology", "words"),
    [
        (Topology(kind="edges", edges=(("a", "b"),)), ["unconnected", "a, b | c"]),
        (Topology(kind="edges", edges=(("a", "x"),)), ['"x"', "expected one of a, b, c"]),
        (Topology(kind="edges", edges=(("a", "a"),)), ["to itself"]),
        (Topology(kind="ring", edges=(("a", "b"),)), ['"ring"', 'expected kind "edges"']),
        (Topology(kind="random-geometric", radius=0.01), ["unconnected"]),
    ],
)
def test_graphs_that_cannot_agree_are_refused(topology: Topology, words: list[str]) -> None:
    with pytest.raises(ConfigError) as error:
        check(topology, ("a", "b", "c"))
    assert all(word in str(error.value) for word in words)
