"""A network as one vector: derivatives and optimiser steps against plain ones."""

import numpy as np
import pytest
import torch
from gymnasium import spaces
from numpy.typing import NDArray

from agent.learning.flat import FlatAscent, FlatNetwork
from agent.learning.networks import build
from agent.learning.optimizers import Adam, Ascent, Optimizer, Sgd
from agent.learning.policies import Network

SPACE = spaces.Box(-1, 1, (3,), np.float32)


def flat_network(seed: int = 0) -> FlatNetwork:
    return FlatNetwork(build(Network((5,)), SPACE, spaces.Discrete(2), critic=True, seed=seed))


def test_the_vector_holds_the_parameters_in_their_order() -> None:
    flat = flat_network()
    weights = torch.cat([p.detach().flatten() for p in flat.network.parameters()])
    assert torch.equal(flat.theta, weights)
    assert sum(int(np.prod(shape)) for _, shape in flat.parts) == flat.theta.numel()


def test_a_loaded_vector_is_what_the_network_computes_with() -> None:
    one, other = flat_network(0), flat_network(1)
    other.load(one.theta.numpy().copy())
    seen = torch.randn(4, 3)
    assert torch.equal(one.network(seen)[0], other.network(seen)[0])


def objective(flat: FlatNetwork, seen: torch.Tensor) -> torch.Tensor:
    logits, values = flat.network(seen)
    total: torch.Tensor = logits.square().sum() + values.sum()
    return total


def test_the_gradient_is_that_of_the_sum_and_can_be_shortened() -> None:
    flat, seen = flat_network(), torch.randn(6, 3)
    weights = list(flat.network.parameters())
    parts = torch.autograd.grad(objective(flat, seen), weights)
    expected = torch.cat([part.flatten() for part in parts])
    length = flat.differentiate((objective(flat, seen[i : i + 2]) for i in (0, 2, 4)), longest=0)
    assert torch.allclose(flat.gradient, expected, atol=1e-5)
    assert length == pytest.approx(float(expected.norm()), rel=1e-5)
    flat.differentiate([objective(flat, seen)], longest=0.25)
    assert float(flat.gradient.norm()) == pytest.approx(0.25, rel=1e-5)


@pytest.mark.parametrize("config", [Sgd(step=0.1), Adam(step=0.01)])
def test_steps_are_those_of_the_tabular_optimiser(config: Optimizer) -> None:
    flat, plain = flat_network(), Ascent(config)
    theta = flat.theta.numpy().copy()
    state: dict[str, NDArray[np.float32]] = {}
    random = np.random.default_rng(0)
    for _ in range(3):  # rounds; the state is carried from one to the next
        ascent = FlatAscent(config, flat, state)
        for _ in range(2):
            gradient = random.normal(size=theta.size).astype(np.float32)
            flat.gradient.copy_(torch.from_numpy(gradient))
            ascent.step()
            theta += plain.step(gradient)
        state = ascent.state()
    np.testing.assert_allclose(flat.theta.numpy(), theta, atol=2e-6)
    assert state.keys() == plain.state.keys()


def test_the_state_of_the_last_round_is_left_as_it_is() -> None:
    flat = flat_network()
    flat.gradient.fill_(1.0)
    first = FlatAscent(Adam(), flat, {})
    first.step()
    state = {name: array.copy() for name, array in first.state().items()}
    kept = {name: array.copy() for name, array in state.items()}
    FlatAscent(Adam(), flat, state).step()
    assert all(np.array_equal(state[name], kept[name]) for name in kept)
