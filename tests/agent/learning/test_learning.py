"""Scores, returns and steps against hand-computed numbers, finite differences and torch."""

import numpy as np
import pytest
import torch
from msgspec.structs import replace

from agent.learning.optimizers import Adam, Ascent, Optimizer, Sgd, decayed
from agent.learning.policies import entropy_gradient, score_sum, softmax
from agent.learning.returns import rewards_to_go


def test_rewards_to_go_by_hand() -> None:
    rewards = np.array([[1.0, 0.0], [0.0, 0.0], [4.0, -1.0]])
    np.testing.assert_allclose(
        rewards_to_go(rewards, 0.5), [[2.0, -0.25], [2.0, -0.5], [4.0, -1.0]]
    )


def test_score_sum_is_the_derivative_of_the_weighted_log_likelihood() -> None:
    rng = np.random.default_rng(0)
    theta, n = rng.normal(size=(5, 3)), 40
    states, actions = rng.integers(0, 5, n), rng.integers(0, 3, n)
    weights = rng.normal(size=n)

    def likelihood(logits: np.ndarray) -> float:
        return float(weights @ np.log(softmax(logits))[states, actions])

    analytic = score_sum(softmax(theta), states, actions, weights)
    for s, a in np.ndindex(5, 3):
        nudge = np.zeros_like(theta)
        nudge[s, a] = 1e-6
        numeric = (likelihood(theta + nudge) - likelihood(theta - nudge)) / 2e-6
        assert analytic[s, a] == pytest.approx(numeric, abs=1e-6)


def test_entropy_gradient_pulls_towards_uniform() -> None:
    policy = np.array([[0.7, 0.3], [0.5, 0.5]])
    np.testing.assert_allclose(entropy_gradient(policy), [[-0.1, 0.1], [0.0, 0.0]])


def test_sgd_is_alpha_g() -> None:
    np.testing.assert_array_equal(Ascent(Sgd(step=0.5)).step(np.array([2.0, -4.0])), [1.0, -2.0])


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_adam_is_torch_adam(kind: type[np.floating]) -> None:
    rng = np.random.default_rng(0)
    ours, ascent = np.zeros(6, kind), Ascent(Adam(step=0.01))
    theirs = torch.zeros(6, dtype=torch.float64 if kind is np.float64 else torch.float32)
    optimizer = torch.optim.Adam([theirs], lr=0.01, maximize=True)
    for _ in range(30):
        gradient = rng.normal(size=6).astype(kind)
        ours = ours + ascent.step(gradient)
        theirs.grad = torch.from_numpy(gradient.copy())
        optimizer.step()
    np.testing.assert_allclose(ours, theirs.numpy(), rtol=1e-5)
    assert ours.dtype == kind


@pytest.mark.parametrize("config", [Sgd(step=0.5, decay=0.4), Adam(step=0.5, decay=0.4)])
def test_the_step_falls_in_a_line_over_the_last_rounds(config: Optimizer) -> None:
    steps = [decayed(config, round_, 10).step for round_ in range(11)]
    np.testing.assert_allclose(steps, [0.5] * 7 + [0.375, 0.25, 0.125, 0.0])
    assert decayed(config, 0, 10) is config
    constant = replace(config, decay=0.0)
    assert decayed(constant, 12, 10) is constant  # more rounds than were asked for
    assert type(decayed(config, 9, 10)) is type(config)
