import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.tabular.chain import LEFT, RIGHT, S1, S3, chain_model
from sim.tabular.episodes import Sampler, sample_episodes, sample_swarm_episodes
from sim.tabular.gridworld import LAYOUTS, UP, grid_model
from sim.tabular.mdp import FiniteMDP, Floats, softmax

LARGEST = 1 - 2**-53  # the largest number that a uniform generator returns


def swarm(seed: int, n_models: int = 4) -> tuple[list[FiniteMDP], Floats, Floats]:
    """Models of layout (b) with various start distributions, random policies, random numbers."""
    rng = np.random.default_rng(seed)
    models = [
        model.with_start((1 - mix) * model.start + mix / 100)
        for model, mix in zip(LAYOUTS["b"].models()[:n_models], (0.0, 0.8, 1.0, 0.0), strict=True)
    ]
    policies = softmax(2 * rng.normal(size=(n_models, 100, 4)))
    return models, policies, rng.random((n_models, 61, 7, 2))


def pick(distribution: Floats, uniform: float) -> int:
    """Inverse distribution function, spelled out."""
    total = 0.0
    for outcome, probability in enumerate(distribution):
        total += probability
        if uniform < total:
            return outcome
    raise AssertionError


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), modified=st.booleans())
def test_agrees_with_a_loop_over_steps(seed: int, modified: bool) -> None:
    rng = np.random.default_rng(seed)
    model = chain_model(2, modified=modified, p=0.7).with_start(rng.dirichlet(np.ones(5)))
    policy, uniforms = rng.dirichlet((1, 1), size=5), rng.random((13, 6, 2))
    episodes = sample_episodes(model, policy, uniforms)
    longest = 0
    for e in range(6):
        state = pick(model.start, uniforms[0, e, 0])
        for t in range(12):
            if model.terminal[state]:
                assert not episodes.active[t:, e].any()
                assert not episodes.rewards[t:, e].any()
                break
            action = pick(policy[state], uniforms[t + 1, e, 0])
            branch = pick(model.probabilities[state, action], uniforms[t + 1, e, 1])
            assert episodes.active[t, e]
            assert episodes.states[t, e] == state
            assert episodes.actions[t, e] == action
            assert episodes.rewards[t, e] == model.rewards[state, action, branch]
            state = int(model.successors[state, action, branch])
            longest = max(longest, t + 1)
        assert episodes.terminated[e] == model.terminal[state]
        assert episodes.last_states[e] == state
    assert episodes.states.shape == (longest, 6)


@pytest.mark.parametrize("seed", range(3))
def test_a_swarm_flies_as_its_members_would_bit_for_bit(seed: int) -> None:
    models, policies, uniforms = swarm(seed)
    together = sample_swarm_episodes(models, policies, uniforms)
    assert together.states.shape[1:] == (4, 7)
    for n, model in enumerate(models):
        alone = sample_episodes(model, policies[n], uniforms[n])
        length = len(alone.states)
        member = together.of_model(n)
        assert not member.active[length:].any()
        for name in ("states", "actions", "rewards", "active"):
            np.testing.assert_array_equal(getattr(member, name)[:length], getattr(alone, name))
        np.testing.assert_array_equal(member.terminated, alone.terminated)
        np.testing.assert_array_equal(member.last_states, alone.last_states)


def test_same_numbers_same_episodes_and_inputs_untouched() -> None:
    models, policies, uniforms = swarm(3)
    sampler, before = Sampler(models), uniforms.copy()
    first, second = sampler(policies, uniforms), sampler(policies, uniforms)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(uniforms, before)
    # A view that is not contiguous is read as what it shows.
    view = sampler(policies, np.asfortranarray(uniforms))
    np.testing.assert_array_equal(view.rewards, first.rewards)


def test_only_as_long_as_the_longest_episode() -> None:
    model = chain_model(1)
    straight = np.eye(2)[[LEFT] * 5]
    episodes = model.sample(straight, np.full((201, 10, 2), 0.5))
    assert episodes.states.shape == (2, 10)
    np.testing.assert_array_equal(episodes.rewards[:, 0], (0, 1))
    assert episodes.terminated.all()
    assert (episodes.last_states == S1).all()


def test_horizon_cuts_off_and_a_terminal_start_has_no_step() -> None:
    wall = np.eye(4)[[UP] * 100]
    model = LAYOUTS["a"].models()[0]
    episodes = model.sample(wall, np.zeros((201, 3, 2)))
    assert episodes.states.shape == (200, 3)
    assert episodes.active.all()
    assert not episodes.terminated.any()
    ended = chain_model(1).with_start(np.eye(5)[S1])
    empty = ended.sample(np.full((5, 2), 0.5), np.zeros((9, 3, 2)))
    assert empty.states.shape == (0, 3)
    assert empty.terminated.all()
    assert (empty.last_states == S1).all()


@pytest.mark.parametrize("uniform", [0.0, LARGEST])
def test_what_has_probability_zero_never_happens(uniform: float) -> None:
    model = chain_model(1)
    # Tenths do not sum to one exactly: a careless inverse picks the impossible last action.
    for action in (LEFT, RIGHT):
        policy = np.eye(2)[[action] * 5]
        episodes = model.sample(policy, np.full((5, 1, 2), uniform))
        assert (episodes.actions == action).all()
        assert episodes.states[0, 0] == S3
    tenths = np.tile([0.0] + [0.1] * 10 + [0.0], (3, 1))
    wide = FiniteMDP(
        successors=np.zeros((3, 12, 1), dtype=np.intp),
        probabilities=np.ones((3, 12, 1)),
        rewards=np.zeros((3, 12, 1)),
        start=np.eye(3)[0],
        terminal=np.zeros(3, dtype=np.bool_),
        gamma=0.9,
    )
    drawn = wide.sample(tenths, np.full((2, 1, 2), uniform)).actions[0, 0]
    assert drawn == (1 if uniform == 0 else 10)


@pytest.mark.statistical
@pytest.mark.parametrize("seed", range(4))
def test_frequencies_agree_with_the_exact_model(seed: int) -> None:
    """Where 4000 episodes end and what they return: within four standard errors."""
    rng = np.random.default_rng(seed)
    start = np.where(np.isin(np.arange(20), (6, 13, 19)), 0, 1) / 17
    model = grid_model((4, 5), [(3, 4)], [(1, 1), (2, 3)], start_distribution=start, gamma=0.9)
    policy = softmax(rng.normal(size=(20, 4)))
    episodes = model.sample(policy, rng.random((1501, 4000, 2)))
    assert episodes.terminated.all()
    for target in (6, 13, 19):
        exact = model.reach_probability(policy, [target])
        found = (episodes.last_states == target).mean()
        assert abs(found - exact) <= 4 * np.sqrt(exact * (1 - exact) / 4000)
    returns = 0.9 ** np.arange(len(episodes.rewards)) @ episodes.rewards
    standard_error = returns.std() / np.sqrt(returns.size)
    assert abs(returns.mean() - model.value(policy)) <= 4 * standard_error


@pytest.mark.statistical
def test_successors_are_drawn_independently_of_actions() -> None:
    """From S3 to the ends in two steps: 0.3 * 0.3 by the left, 0.7 * 0.7 by the right."""
    model = chain_model(1, modified=True, p=0.7)
    policy = np.tile((0.3, 0.7), (5, 1))
    episodes = model.sample(policy, np.random.default_rng(1).random((3, 20000, 2)))
    for action in (LEFT, RIGHT):
        ended = episodes.rewards[1, episodes.actions[1] == action] != 0
        assert abs(ended.mean() - 0.58) <= 4 * np.sqrt(0.58 * 0.42 / ended.size)


def test_bad_inputs_are_refused() -> None:
    model = chain_model(1)
    policy = np.full((5, 2), 0.5)
    with pytest.raises(ValueError, match=r"uniforms: shape .* expected \(1, H\+1, E, 2\)"):
        model.sample(policy, np.zeros((5, 3)))
    with pytest.raises(ValueError, match=r"policies: shape \(1, 5, 3\), expected \(1, 5, 2\)"):
        model.sample(np.full((5, 3), 1 / 3), np.zeros((5, 3, 2)))
    with pytest.raises(ValueError, match=r"policies: .* expected distributions"):
        model.sample(np.full((5, 2), np.nan), np.zeros((5, 3, 2)))
    with pytest.raises(ValueError, match="models: shapes"):
        Sampler([model, grid_model((2, 2), [(1, 1)])])
    with pytest.raises(ValueError, match="models: "):
        Sampler([])
