"""The paper's closed forms, Sec. 2.2 and Appendix A, with correction 7 of the notes."""

import math
from functools import partial

import numpy as np
import pytest

from sim.tabular.chain import LEFT, RIGHT, S2, S3, S4, Chain, chain_model
from sim.tabular.mdp import Floats

approx = partial(pytest.approx, rel=0, abs=1e-9)
GAMMAS = [0.3, math.sqrt(0.5), 0.9, 0.99]


def policy_with(left_in_s3: float) -> Floats:
    """Left in S2 and S4, as is best in example 1 and does not matter in example 2."""
    policy = np.tile((1.0, 0.0), (5, 1))
    policy[S3] = left_in_s3, 1 - left_in_s3
    return policy


def total(left_in_s3: float, gamma: float, p: float | None = None) -> float:
    policy = policy_with(left_in_s3)
    return sum(
        chain_model(task, modified=p is not None, p=p or 0.5, gamma=gamma).value(policy)
        for task in (1, 2)
    )


def total_gradient(policy: Floats, gamma: float, p: float | None = None) -> Floats:
    return sum(
        (
            chain_model(task, modified=p is not None, p=p or 0.5, gamma=gamma).gradient(policy, 0)
            for task in (1, 2)
        ),
        start=np.zeros((5, 2)),
    )


@pytest.mark.parametrize("gamma", GAMMAS)
def test_example_1_is_best_at_one_half(gamma: float) -> None:
    assert total(0.5, gamma) == approx(2 * gamma / (2 - gamma**2))
    for q in (0.0, 0.2, 0.7, 1.0):
        by_hand = q * gamma / (1 - (1 - q) * gamma**2) + (1 - q) * gamma / (1 - q * gamma**2)
        assert total(q, gamma) == approx(by_hand)
        assert total(q, gamma) < total(0.5, gamma)
    assert total(1.0, gamma) == approx(gamma)
    np.testing.assert_allclose(total_gradient(policy_with(0.5), gamma)[S3], 0, atol=1e-9)


def test_example_1_is_best_with_left_in_s2_and_s4() -> None:
    best = total(0.5, 0.9)
    for state in (S2, S4):
        for chance in (0.0, 0.5, 0.9):
            policy = policy_with(0.5)
            policy[state] = chance, 1 - chance
            assert sum(chain_model(task, gamma=0.9).value(policy) for task in (1, 2)) < best


@pytest.mark.parametrize("p", [0.5, 0.6, 0.75, 0.9, 1.0])
def test_example_2_at_the_gamma_of_the_paper(p: float) -> None:
    gamma, root = math.sqrt(0.5), math.sqrt(2)
    ends = root * (2 * p - 1) / ((p - 2) * (p + 1))
    middle = 2 * root * (1 - 2 * p) / 3
    assert total(0.0, gamma, p) == approx(ends)
    assert total(1.0, gamma, p) == approx(ends)
    assert total(0.5, gamma, p) == approx(middle)
    assert (ends > middle) == (p > 0.5)


@pytest.mark.parametrize("gamma", GAMMAS)
@pytest.mark.parametrize("p", [0.6, 0.75, 1.0])
def test_example_2_has_three_stationary_points_the_middle_one_worst(gamma: float, p: float) -> None:
    for q in (0.0, 0.5, 1.0):
        np.testing.assert_allclose(total_gradient(policy_with(q), gamma, p), 0, atol=1e-9)
    rising = [total(q, gamma, p) for q in (0.5, 0.6, 0.75, 0.9, 1.0)]
    assert rising == sorted(rising)
    assert total(0.25, gamma, p) == approx(total(0.75, gamma, p))
    assert rising[0] < rising[1]
    general = gamma * (-2 * gamma**2 * p + gamma**2 + 2 * p - 1)
    general /= gamma**4 * p**2 - gamma**4 * p + gamma**2 - 1
    assert total(1.0, gamma, p) == approx(general)


def test_example_2_does_not_heed_the_action_in_s2_and_s4() -> None:
    for task in (1, 2):
        model = chain_model(task, modified=True, p=0.8)
        np.testing.assert_array_equal(model.probabilities[S2, LEFT], model.probabilities[S2, RIGHT])
        right = 0.8 if task == 1 else 0.2
        np.testing.assert_allclose(model.probabilities[S4, LEFT], (1 - right, right))


@pytest.mark.parametrize("task", [1, 2])
def test_environment_walks_as_its_model_says(task: int) -> None:
    env = Chain(task, render_mode="ansi")
    assert env.reset(seed=0)[0] == S3
    prize_first = LEFT if task == 1 else RIGHT
    observation, reward, terminated, truncated, _ = env.step(np.int64(prize_first))
    assert (reward, terminated, truncated) == (0, False, False)
    assert env.render() == ("Go..#\n" if task == 1 else "#..oG\n")
    observation, reward, terminated, _, _ = env.step(np.int64(LEFT))
    assert (observation, reward, terminated) == (env.goal_states[0], 1, True)


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="task: 3, expected 1 or 2"):
        chain_model(3)
    with pytest.raises(ValueError, match=r"p: 1\.5, expected a probability"):
        chain_model(1, modified=True, p=1.5)
