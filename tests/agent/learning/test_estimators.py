from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.learning.estimators import A2C, PPO, Reinforce, Sampled
from agent.learning.learner import Vector
from agent.learning.policies import softmax
from agent.learning.returns import generalized_advantages, rewards_to_go
from agent.learning.tabular import gains, policy_gradient, sampled_step, value_gradient
from sim.tabular.chain import chain_model
from sim.tabular.episodes import Episodes
from sim.tabular.gridworld import grid_model
from sim.tabular.mdp import FiniteMDP, Floats

GAMMA, LAMBDA = 0.9, 0.05
SETTINGS: dict[str, Any] = {"gamma": GAMMA, "entropy_weight": LAMBDA, "discount_visits": True}
MODEL = grid_model((3, 4), [(2, 3)], [(1, 1)], gamma=GAMMA)
SHAPE = (MODEL.n_states, MODEL.n_actions)


def fly(
    model: FiniteMDP, policy: Floats, n_episodes: int, seed: int, horizon: int = 150
) -> Episodes:
    rng = np.random.default_rng(seed)
    return model.sample(policy, rng.random((horizon + 1, n_episodes, 2)))


def each_alone(episodes: Episodes) -> Episodes:
    """Every episode as the flight of an agent of its own: (T, E) -> (T, E, 1)."""
    fields: Any = (field[..., None] for field in episodes)
    return Episodes(*fields)


def agrees(samples: Floats, exact: Floats) -> None:
    """The mean of (E, ...) samples is the exact value within five standard errors everywhere."""
    error = samples.std(axis=0) / np.sqrt(len(samples))
    distance = np.abs(samples.mean(axis=0) - exact)
    assert (distance <= 5 * error + 1e-12).all()
    assert np.linalg.norm(distance) < 0.2 * np.linalg.norm(exact)  # and the samples are enough


# --- unbiased -------------------------------------------------------------------------------------


@pytest.mark.statistical
@pytest.mark.parametrize("critic", ["zero", "exact", "wrong"])
@pytest.mark.parametrize("estimator", [Reinforce(**SETTINGS), A2C(**SETTINGS), PPO(**SETTINGS)])
def test_monte_carlo_gradients_agree_with_the_exact_one(estimator: Sampled, critic: str) -> None:
    rng = np.random.default_rng(5)
    policy = softmax(0.7 * rng.normal(size=SHAPE))
    values = {
        "zero": np.zeros(SHAPE[0]),
        "exact": MODEL.values(policy),
        "wrong": rng.normal(size=SHAPE[0]),
    }[critic]
    flown = each_alone(fly(MODEL, policy, 4000, seed=1))
    many = np.broadcast_to(policy, (4000, *SHAPE))
    gain = gains(np.broadcast_to(values, (4000, SHAPE[0])), flown, estimator)
    gain = gain * GAMMA ** np.arange(len(gain))[:, None, None]
    found = policy_gradient(many, flown, estimator.weight(1.0, gain), LAMBDA)
    agrees(found, MODEL.gradient(policy, LAMBDA))


@pytest.mark.statistical
def test_bootstrapping_from_an_exact_critic_is_unbiased_and_has_less_variance() -> None:
    policy = softmax(np.random.default_rng(6).normal(size=SHAPE))
    exact = MODEL.gradient(policy, 0.0)
    flown = each_alone(fly(MODEL, policy, 4000, seed=2, horizon=8))  # most are cut off
    many = np.broadcast_to(policy, (4000, *SHAPE))
    values = np.broadcast_to(MODEL.values(policy), (4000, SHAPE[0]))
    spread = {}
    for trace in (0.0, 1.0):
        gain = gains(values, flown, A2C(**SETTINGS, trace=trace))
        gain = gain * GAMMA ** np.arange(len(gain))[:, None, None]
        found = policy_gradient(many, flown, gain, 0.0)
        # Eight steps see the visits of eight steps: compare where that is all there is.
        truncated = exact_of_horizon(policy, 8)
        agrees(found, truncated)
        spread[trace] = found.var(axis=0).sum()
    assert spread[0.0] < spread[1.0]
    assert np.linalg.norm(truncated - exact) < np.linalg.norm(exact)


def exact_of_horizon(policy: Floats, horizon: int) -> Floats:
    """The part of Eq. 9 that the first steps contribute, with true advantages."""
    moves, visits = MODEL.transitions(policy), np.zeros(SHAPE[0])
    here = MODEL.start
    for t in range(horizon):
        visits += GAMMA**t * here
        here = here @ moves
    return np.asarray(visits[:, None] * policy * MODEL.advantages(policy))


@pytest.mark.statistical
def test_ppo_away_from_the_behaviour_is_the_surrogate_of_importance_sampling() -> None:
    """Unclipped: the gradient of sum_s d_old(s) sum_a pi(a|s) A_old(s, a)."""
    rng = np.random.default_rng(7)
    logits = rng.normal(size=SHAPE)
    old, new = softmax(logits), softmax(logits + 0.2 * rng.normal(size=SHAPE))
    flown = each_alone(fly(MODEL, old, 4000, seed=3))
    values = np.broadcast_to(MODEL.values(old), (4000, SHAPE[0]))
    ppo = PPO(**SETTINGS, clip=1e9)
    gain = gains(values, flown, ppo) * GAMMA ** np.arange(len(flown.states))[:, None, None]
    ratio = (new / old)[flown.states, flown.actions]
    found = policy_gradient(
        np.broadcast_to(new, (4000, *SHAPE)), flown, ppo.weight(ratio, gain), 0.0
    )
    advantages = MODEL.advantages(old)
    baseline = (new * advantages).sum(axis=1, keepdims=True)
    occupancy = MODEL.visitation(old)[:, None] / (1 - GAMMA)
    agrees(found, occupancy * new * (advantages - baseline))


# --- equations ------------------------------------------------------------------------------------


def test_ppo_clips_where_there_is_nothing_more_to_gain() -> None:
    ratio = np.array([1.0, 1.3, 1.3, 0.7, 0.7, 1.1])
    gain = np.array([2.0, 2.0, -2.0, 2.0, -2.0, -1.0])
    np.testing.assert_allclose(
        PPO(clip=0.2).weight(ratio, gain), [2.0, 0.0, -2.6, 1.4, 0.0, -1.1], atol=1e-15
    )


def test_the_weights_take_tensors() -> None:
    import torch

    ratio, gain = np.array([1.0, 1.3, 0.7]), np.array([2.0, 2.0, -2.0])
    for estimator in (Reinforce(), A2C(), PPO()):
        found = estimator.weight(torch.tensor(ratio), torch.tensor(gain))
        np.testing.assert_array_equal(found.numpy(), estimator.weight(ratio, gain))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), trace=st.floats(0, 1))
def test_advantages_of_a_loop_over_time(seed: int, trace: float) -> None:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(0, 7, size=5)
    active = np.arange(6)[:, None] < lengths
    rewards = np.where(active, rng.normal(size=(6, 5)), 0.0)
    values, last = rng.normal(size=(6, 5)), rng.normal(size=5)
    found = generalized_advantages(rewards, values, last, active, 0.9, trace)
    for e, length in enumerate(lengths):
        ahead, advantage = last[e], 0.0
        for t in reversed(range(length)):
            advantage = rewards[t, e] + 0.9 * ahead - values[t, e] + 0.9 * trace * advantage
            ahead = values[t, e]
            assert found[t, e] == pytest.approx(advantage, abs=1e-12)
        assert not found[length:, e].any()


def test_a_full_trace_is_the_return_less_the_critic() -> None:
    flown = fly(MODEL, np.full(SHAPE, 0.25), 50, seed=4)
    assert flown.terminated.all()
    values = np.random.default_rng(0).normal(size=SHAPE[0])
    found = gains(values, flown, A2C(gamma=GAMMA, trace=1.0))
    expected = rewards_to_go(flown.rewards, GAMMA) - values[flown.states]
    np.testing.assert_allclose(found, np.where(flown.active, expected, 0.0), atol=1e-12)


def test_the_critic_learns_the_mean_return() -> None:
    """At the mean target of every visited state there is nothing left to learn."""
    flown = fly(MODEL, np.full(SHAPE, 0.25), 50, seed=5)
    targets, values = rewards_to_go(flown.rewards, GAMMA), np.zeros(SHAPE[0])
    values = values + value_gradient(values, flown, targets)
    assert values[flown.states[0]].all()
    assert np.abs(value_gradient(values, flown, targets)).max() < 1e-12


@pytest.mark.parametrize("kind", [Reinforce, A2C, PPO])
def test_many_agents_at_once_take_the_same_steps_as_each_alone(kind: type[Sampled]) -> None:
    """Bit for bit, whatever else is in the arrays: the simulator rests on it."""
    estimator = kind(gamma=GAMMA, episodes=7)
    rng = np.random.default_rng(8)
    critic = 0 if kind is Reinforce else 5
    thetas = rng.normal(size=(3, 10 + critic)).astype(np.float32)
    policies = softmax(thetas[:, :10].reshape(3, 5, 2))
    model = chain_model(1, modified=True, gamma=GAMMA)
    flights = [fly(model, policy, 7, seed=n, horizon=20) for n, policy in enumerate(policies)]
    longest = max(len(flight.states) for flight in flights)
    padded = [
        [np.pad(f, ((0, longest - len(f)), (0, 0))) for f in flight[:4]] for flight in flights
    ]
    ends = [np.stack([flight[k] for flight in flights]) for k in (4, 5)]
    together = Episodes(*(np.stack(parts, axis=1) for parts in zip(*padded, strict=True)), *ends)

    def ascend(gradient: Vector) -> Vector:
        return np.asarray(np.float32(0.5) * gradient)

    steps, _ = sampled_step(thetas, policies, together, estimator, ascend)
    for n, flight in enumerate(flights):
        alone, _ = sampled_step(thetas[n], policies[n], flight, estimator, ascend)
        assert alone.dtype == np.float32
        assert alone.tobytes() == steps[n].tobytes()
