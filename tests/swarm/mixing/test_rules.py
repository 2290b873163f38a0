import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from swarm.memory import MemoryExchange
from swarm.mixing.compression import CODECS
from swarm.mixing.loss import Loss
from swarm.mixing.rules import RULES, Missing, Mixer, Mixing, RuleName
from swarm.mixing.weights import Topology, graph, neighbours, weight_matrix

Floats = NDArray[np.float64]
N, D, STEP = 6, 3, 0.1
MEMBERS = tuple(f"drone{i}" for i in range(N))
RING = {agent: neighbours(Topology(), MEMBERS, agent) for agent in MEMBERS}
W = weight_matrix(graph(Topology(), MEMBERS), MEMBERS)
EXACT: list[RuleName] = ["exact-diffusion", "extra", "gradient-tracking"]
every_rule = pytest.mark.parametrize("rule", list(RULES))


class Quadratics:
    """Agent i climbs ``-|A_i (theta - b_i)|^2 / 2``; ``best`` is where the sum is largest."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.hessians = np.stack([np.diag(rng.uniform(0.2, 1.5, D)) for _ in range(N)])
        self.centres = 3 * rng.normal(size=(N, D))
        pull = np.einsum("nij,nj->i", self.hessians, self.centres)
        self.best = np.linalg.solve(self.hessians.sum(axis=0), pull)

    def steps(self, thetas: Floats) -> Floats:
        return np.asarray(STEP * np.einsum("nij,nj->ni", self.hessians, self.centres - thetas))


class Ring:
    """Six mixers that talk over an exchange in memory."""

    def __init__(self, mixing: Mixing, loss: Loss | None = None) -> None:
        self.mixers = [Mixer(mixing) for _ in MEMBERS]
        self.exchange = MemoryExchange(RING, loss or Loss(), mixing.missing)
        self.round = 0

    def mix(self, thetas: Floats, steps: Floats) -> Floats:
        for agent, mixer, theta, step in zip(MEMBERS, self.mixers, thetas, steps, strict=True):
            body = mixer.outgoing(theta, step)
            vector = mixer.codec.decode(body, D * mixer.rule.copies, theta.dtype)
            self.exchange.publish(self.round, agent, vector)
        new = [
            mixer.mix(theta, step, self.exchange.gather(self.round, agent), weights(i))
            for i, (agent, mixer, theta, step) in enumerate(
                zip(MEMBERS, self.mixers, thetas, steps, strict=True)
            )
        ]
        self.round += 1
        return np.stack(new)


def weights(i: int) -> dict[str, float]:
    return {other: float(W[i, MEMBERS.index(other)]) for other in RING[MEMBERS[i]]}


def learn(ring: Ring, problem: Quadratics, rounds: int) -> Floats:
    thetas = np.zeros((N, D))
    for _ in range(rounds):
        thetas = ring.mix(thetas, problem.steps(thetas))
    return thetas


def matrix_form(rule: RuleName, problem: Quadratics, rounds: int) -> Floats:
    """The rules as their papers print them, for all agents at once."""
    theta = np.zeros((N, D))
    if rule == "dcpg":
        for _ in range(rounds):
            theta = W @ theta + problem.steps(theta)
    elif rule == "atc":
        for _ in range(rounds):
            theta = W @ (theta + problem.steps(theta))
    elif rule == "exact-diffusion":
        psi = theta
        for _ in range(rounds):
            adapted = theta + problem.steps(theta)
            theta, psi = W @ (adapted + theta - psi), adapted
    elif rule == "extra":  # Shi et al. 2015, Eq. 2.13
        old, theta = theta, W @ theta + problem.steps(theta)
        half = (np.eye(N) + W) / 2
        for _ in range(rounds - 1):
            change = problem.steps(theta) - problem.steps(old)
            old, theta = theta, (np.eye(N) + W) @ theta - half @ old + change
    else:  # DIGing
        tracker = problem.steps(theta)
        for _ in range(rounds):
            new = W @ theta + tracker
            tracker = W @ tracker + problem.steps(new) - problem.steps(theta)
            theta = new
    return theta


@every_rule
def test_every_rule_is_its_matrix_form(rule: RuleName) -> None:
    problem = Quadratics(1)
    for rounds in (1, 2, 3, 40):
        found = learn(Ring(Mixing(rule=rule)), problem, rounds)
        np.testing.assert_allclose(found, matrix_form(rule, problem, rounds), atol=1e-12)


@pytest.mark.parametrize("rule", EXACT)
def test_the_optimum_of_the_sum_is_reached_exactly(rule: RuleName) -> None:
    problem = Quadratics(2)
    found = learn(Ring(Mixing(rule=rule)), problem, 1200)
    np.testing.assert_allclose(found, np.tile(problem.best, (N, 1)), atol=1e-9)


@pytest.mark.parametrize("rule", ["dcpg", "atc"])
def test_plain_mixing_keeps_a_bias(rule: RuleName) -> None:
    problem = Quadratics(2)
    thetas = learn(Ring(Mixing(rule=rule)), problem, 1200)
    again = Ring(Mixing(rule=rule)).mix(thetas, problem.steps(thetas))
    np.testing.assert_allclose(again, thetas, atol=1e-12)  # it has converged, elsewhere:
    assert np.abs(thetas - problem.best).max() > 0.1


@every_rule
@pytest.mark.parametrize("compression", list(CODECS))
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_mixing_alone_conserves_the_mean(rule: RuleName, compression: str, seed: int) -> None:
    thetas = 10 * np.random.default_rng(seed).normal(size=(N, D))
    mean, ring = thetas.mean(axis=0), Ring(Mixing(rule=rule, compression=compression))  # type: ignore[arg-type]
    for _ in range(5):
        thetas = ring.mix(thetas, np.zeros((N, D)))
        np.testing.assert_allclose(thetas.mean(axis=0), mean, atol=1e-9)


@every_rule
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), probability=st.floats(0, 1))
def test_the_symmetric_drop_conserves_the_mean(
    rule: RuleName, seed: int, probability: float
) -> None:
    thetas = np.random.default_rng(seed).normal(size=(N, D))
    mean = thetas.mean(axis=0)
    ring = Ring(Mixing(rule=rule, missing="symmetric"), Loss(probability, seed % 1000))
    for _ in range(8):
        thetas = ring.mix(thetas, np.zeros((N, D)))
        np.testing.assert_allclose(thetas.mean(axis=0), mean, atol=1e-12)


@every_rule
@pytest.mark.parametrize("missing", ["stale", "give-back", "symmetric"])
def test_agents_that_agree_and_have_nothing_to_learn_stay(rule: RuleName, missing: Missing) -> None:
    thetas = np.tile([1.0, -2.0, 3.0], (N, 1))
    ring = Ring(Mixing(rule=rule, missing=missing), Loss(0.5))
    for _ in range(5):
        np.testing.assert_allclose(ring.mix(thetas, np.zeros((N, D))), thetas, atol=1e-15)


def test_what_counts_in_place_of_a_lost_message() -> None:
    here, there = np.array([1.0]), np.array([3.0])
    expected: dict[Missing, float] = {"stale": 2.0, "give-back": 1.0, "symmetric": 1.0}
    for missing, theta in expected.items():
        mixer = Mixer(Mixing(missing=missing))
        for arrived in ({"other": there}, {}):
            mixer.outgoing(here, here)
            mixed = mixer.mix(here, np.zeros(1), arrived, {"other": 0.5})
        assert mixed == theta


def test_extra_with_symmetric_drop_still_finds_the_optimum_and_stale_copies_do_not() -> None:
    problem = Quadratics(3)
    loss = Loss(0.3, 1)
    found = learn(Ring(Mixing(rule="extra", missing="symmetric"), loss), problem, 1000)
    np.testing.assert_allclose(found, np.tile(problem.best, (N, 1)), atol=1e-6)
    stale = learn(Ring(Mixing(rule="extra", missing="stale"), loss), problem, 1000)
    assert np.abs(stale - problem.best).max() > 1


@pytest.mark.parametrize("rule", list(RULES))
def test_single_precision_stays_single(rule: RuleName) -> None:
    mixer = Mixer(Mixing(rule=rule))
    theta = np.ones(D, np.float32)
    mixer.outgoing(theta, theta)
    vector = np.ones(D * mixer.rule.copies, np.float32)
    assert mixer.mix(theta, theta, {"other": vector}, {"other": 0.25}).dtype == np.float32
    assert all(kept.dtype == np.float32 for kept in mixer.state.values())
