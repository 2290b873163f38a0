import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.tabular.chain import LEFT, RIGHT, S1, S3, S5, chain_model
from sim.tabular.gridworld import LAYOUTS, grid_model
from sim.tabular.mdp import FiniteMDP, Floats, relative_entropy, softmax

SEEDS = st.integers(0, 2**32 - 1)


def random_model(seed: int, gamma: float = 0.9) -> FiniteMDP:
    """Six states, the last terminal; three actions, two successors, some of them impossible."""
    rng = np.random.default_rng(seed)
    successors = rng.integers(6, size=(6, 3, 2))
    weights = rng.random((6, 3, 2)) * (rng.random((6, 3, 2)) < 0.8)
    weights[..., 0] += 0.1
    rewards = rng.uniform(-1, 1, (6, 3, 2))
    successors[-1], rewards[-1] = 5, 0.0
    return FiniteMDP(
        successors=successors,
        probabilities=weights / weights.sum(axis=-1, keepdims=True),
        rewards=rewards,
        start=rng.dirichlet(np.ones(6)),
        terminal=np.arange(6) == 5,
        gamma=gamma,
    )


def random_policy(seed: int) -> Floats:
    return softmax(np.random.default_rng(seed).normal(size=(6, 3)))


def some_policy(seed: int) -> Floats:
    """Stochastic or, every other time, deterministic."""
    policy = random_policy(seed)
    return policy if seed % 2 else np.eye(3)[policy.argmax(axis=1)]


def by_plain_sums(
    model: FiniteMDP, policy: Floats, entropy_weight: float
) -> tuple[Floats, Floats, Floats]:
    """V, d and the gradient of Eq. 9 from the defining series: loops, no linear algebra."""
    n_states, n_actions, n_branches = model.successors.shape
    moves = np.zeros((n_states, n_states))
    gains = np.zeros((n_states, n_actions))
    for s in range(n_states):
        for a in range(n_actions):
            for b in range(n_branches):
                chance = model.probabilities[s, a, b]
                moves[s, model.successors[s, a, b]] += policy[s, a] * chance
                gains[s, a] += chance * model.rewards[s, a, b]
    expected = np.array([sum(policy[s] * gains[s]) for s in range(n_states)])
    values, visits, here, weight = np.zeros(n_states), np.zeros(n_states), model.start, 1.0
    ahead = np.eye(n_states)
    while weight > 1e-18:
        values = values + weight * ahead @ expected
        visits = visits + (1 - model.gamma) * weight * here
        ahead, here, weight = ahead @ moves, here @ moves, weight * model.gamma
    gradient = np.zeros((n_states, n_actions))
    for s in range(n_states):
        for a in range(n_actions):
            follow = sum(
                model.probabilities[s, a, b] * values[model.successors[s, a, b]]
                for b in range(n_branches)
            )
            advantage = gains[s, a] + model.gamma * follow - values[s]
            gradient[s, a] = visits[s] / (1 - model.gamma) * policy[s, a] * advantage
            gradient[s, a] += entropy_weight / n_states * (1 / n_actions - policy[s, a])
    return values, visits, gradient


@pytest.mark.parametrize("seed", range(6))
def test_linear_solves_agree_with_plain_sums(seed: int) -> None:
    model, policy = random_model(seed), some_policy(seed)
    values, visits, gradient = by_plain_sums(model, policy, 0.03)
    np.testing.assert_allclose(model.values(policy), values, rtol=0, atol=1e-10)
    np.testing.assert_allclose(model.visitation(policy), visits, rtol=0, atol=1e-10)
    np.testing.assert_allclose(model.gradient(policy, 0.03), gradient, rtol=0, atol=1e-10)


@pytest.mark.parametrize("entropy_weight", [0.0, 0.03, 1.0])
def test_gradient_agrees_with_finite_differences(entropy_weight: float) -> None:
    model = random_model(7)
    logits = np.random.default_rng(8).normal(size=(6, 3))
    step = 1e-5
    slopes = np.zeros_like(logits)
    for index in np.ndindex(logits.shape):
        nudge = np.zeros_like(logits)
        nudge[index] = step
        up, down = softmax(logits + nudge), softmax(logits - nudge)
        rise = model.objective(up, entropy_weight) - model.objective(down, entropy_weight)
        slopes[index] = rise / (2 * step)
    gradient = model.gradient(softmax(logits), entropy_weight)
    np.testing.assert_allclose(gradient, slopes, rtol=0, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, gamma=st.floats(0.0, 0.99))
def test_identities(seed: int, gamma: float) -> None:
    model, policy = random_model(seed, gamma), some_policy(seed)
    values, advantages = model.values(policy), model.advantages(policy)
    visits = model.visitation(policy)
    np.testing.assert_allclose((policy * advantages).sum(axis=1), 0, atol=1e-11)
    np.testing.assert_allclose(model.action_values(policy) - values[:, None], advantages)
    assert visits.sum() == pytest.approx(1, abs=1e-12)
    assert visits.min() >= -1e-15
    assert np.abs(values).max() <= np.abs(model.rewards).max() / (1 - gamma) + 1e-9
    # The return is also what is earned where time is spent.
    earned = (model.probabilities * model.rewards).sum(axis=2)
    assert visits @ (policy * earned).sum(axis=1) / (1 - gamma) == pytest.approx(
        model.value(policy), abs=1e-10
    )
    # Softmax logits may be shifted per state: the gradient has no such component.
    np.testing.assert_allclose(model.gradient(policy, 0.1).sum(axis=1), 0, atol=1e-11)
    assert model.values(policy)[-1] == 0


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS)
def test_reach_probability_is_the_limit_of_many_steps(seed: int) -> None:
    model, policy = random_model(seed), some_policy(seed)
    here, moves = model.start, np.linalg.matrix_power(model.transitions(policy), 2**20)
    assert model.reach_probability(policy, [5]) == pytest.approx((here @ moves)[5], abs=1e-9)


def line(n: int) -> FiniteMDP:
    """0 and n-1 terminal, from 1 on actions 0 left and 1 right; starts in 1."""
    states = np.arange(n)
    successors = np.stack([states - 1, states + 1], axis=1)
    successors[[0, -1]] = states[[0, -1], None]
    return FiniteMDP(
        successors=successors[:, :, None],
        probabilities=np.ones((n, 2, 1)),
        rewards=np.zeros((n, 2, 1)),
        start=np.eye(n)[1],
        terminal=(states == 0) | (states == n - 1),
        gamma=0.9,
    )


def test_reach_probability_of_the_gambler() -> None:
    model, up = line(10), 0.6
    policy = np.tile((1 - up, up), (10, 1))
    ratio = (1 - up) / up
    expected = (1 - ratio) / (1 - ratio**9)
    assert model.reach_probability(policy, [9]) == pytest.approx(expected, abs=1e-12)
    assert model.reach_probability(policy, [0]) == pytest.approx(1 - expected, abs=1e-12)
    assert model.reach_probability(policy, [0, 9]) == pytest.approx(1, abs=1e-12)


def test_reach_probability_of_a_policy_that_may_wander_for_ever() -> None:
    model = chain_model(2)
    policy = np.tile((1.0, 0.0), (5, 1))  # left and back: S3, S2, S3, ... in task 2
    assert model.reach_probability(policy, [S1]) == 0
    assert model.reach_probability(policy, [S5]) == 0
    assert model.reach_probability(policy, []) == 0
    assert model.with_start(np.eye(5)[S5]).reach_probability(policy, [S5]) == 1
    # Half of the starts end at once, the others never.
    mixed = model.with_start(np.eye(5)[[S3, S5]].mean(axis=0))
    assert mixed.reach_probability(policy, [S5]) == 0.5


def test_reach_probability_when_a_loop_is_left_once_in_1e30_steps() -> None:
    model = line(4)
    policy = np.array([(0.5, 0.5), (1e-30, 1.0), (1.0, 3e-30), (0.5, 0.5)])
    assert model.reach_probability(policy, [0]) == pytest.approx(0.25, rel=1e-12)


def test_relative_entropy() -> None:
    assert relative_entropy(np.full((7, 4), 0.25)) == pytest.approx(0, abs=1e-15)
    policy = np.array([(0.5, 0.5), (0.25, 0.75)])
    by_hand = -(math.log(0.5) * 2 + math.log(0.25) + math.log(0.75)) / 4 - math.log(2)
    assert relative_entropy(policy) == pytest.approx(by_hand, abs=1e-15)
    assert relative_entropy(np.eye(2)) == math.inf


def test_deterministic_policies_have_a_value_and_an_objective_without_entropy() -> None:
    model = chain_model(1)
    policy = np.eye(2)[[LEFT] * 5]
    assert model.objective(policy, 0.0) == model.value(policy) == pytest.approx(0.99)
    assert model.objective(policy, 0.03) == -math.inf
    assert np.isfinite(model.gradient(policy, 0.03)).all()


def test_softmax_survives_large_logits() -> None:
    np.testing.assert_array_equal(softmax(np.array([[1e4, 0.0]])), [[1.0, 0.0]])
    assert softmax(np.zeros((3, 5, 4)))[2, 4, 1] == 0.25


def test_start_is_exchanged_and_nothing_else() -> None:
    model = LAYOUTS["a"].models()[0]
    start = 0.2 * model.start + 0.8 / model.n_states
    moved = model.with_start(start)
    np.testing.assert_array_equal(moved.start, start)
    np.testing.assert_array_equal(moved.rewards, model.rewards)
    policy = np.full((100, 4), 0.25)
    assert moved.value(policy) == pytest.approx(start @ model.values(policy), abs=1e-12)


def test_value_of_a_straight_flight_is_a_power_of_gamma() -> None:
    model = grid_model((1, 6), [(0, 5)], gamma=0.9)
    assert model.value(np.eye(4)[[RIGHT + 2] * 6]) == pytest.approx(0.9**4, abs=1e-12)


def test_arrays_are_copied_and_read_only() -> None:
    start = np.eye(5)[S3]
    model = chain_model(1).with_start(start)
    start[:] = 7
    assert model.start[S3] == 1
    with pytest.raises(ValueError, match="read-only"):
        model.start[0] = 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"successors": np.zeros((5, 2))}, r"successors: shape \(5, 2\), expected \(S, A, B\)"),
        ({"successors": np.full((5, 2, 2), 5)}, r"successors: a state outside 0\.\.4"),
        ({"probabilities": np.ones((5, 2, 1))}, r"probabilities: shape \(5, 2, 1\)"),
        ({"probabilities": np.ones((5, 2, 2))}, "probabilities: .* expected distributions"),
        ({"rewards": np.full((5, 2, 2), np.nan)}, "rewards: a value that is not finite"),
        ({"rewards": np.ones((5, 2, 2))}, "terminal: every terminal state must stay"),
        ({"start": np.ones(4) / 4}, r"start: shape \(4,\), expected \(5,\)"),
        ({"start": np.full(5, np.nan)}, "start: .* expected distributions"),
        ({"start": np.array([2.0, -1, 0, 0, 0])}, "start: smallest -1"),
        ({"terminal": np.ones(5)}, "terminal: every terminal state must stay"),
        ({"gamma": 1.0}, r"gamma: 1\.0, expected a number in \[0, 1\)"),
        ({"gamma": math.nan}, "gamma: nan"),
    ],
)
def test_bad_models_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(chain_model(1), **change)


@pytest.mark.parametrize("policy", [np.ones((5, 2)), np.full((5, 3), 1 / 3), np.zeros((2, 5))])
def test_bad_policies_are_refused(policy: Floats) -> None:
    with pytest.raises(ValueError, match="policy: "):
        chain_model(1).values(policy)
