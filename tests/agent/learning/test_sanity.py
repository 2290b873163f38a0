"""Every estimator learns to hold a pole up, with a network, over 5 seeds.

The scores are what all seeds of a calibration run passed with room to spare; seeds are fixed, so a
failure means that something changed.
"""

import numpy as np
import pytest

from agent.config.experiment import AgentEntry, SwarmFile, Task, Training
from agent.learning.estimators import A2C, PPO, Reinforce, Sampled
from agent.learning.neural import NeuralLearner
from agent.learning.optimizers import Adam
from agent.learning.policies import Network

SEEDS = range(5)
CASES: dict[str, tuple[Sampled, Training, float, int, float]] = {
    # estimator, training, step, rounds, steps that the best tenth of rounds must hold the pole up
    "reinforce": (
        Reinforce(entropy_weight=0.0, horizon=500),
        Training(worlds=8, segment=64, standardize=True, gradient_clip=0.5),
        4e-3, 45, 195,
    ),
    "a2c": (
        A2C(entropy_weight=0.0, horizon=500, trace=0.95),
        Training(worlds=8, segment=16, standardize=True, reward_scale=0.1, gradient_clip=0.5),
        3e-3, 250, 120,
    ),
    "ppo": (
        PPO(entropy_weight=0.0, horizon=500, trace=0.95, epochs=4),
        Training(worlds=8, segment=64, minibatch=128, standardize=True, reward_scale=0.1,
                 gradient_clip=0.5),
        2e-3, 45, 195,
    ),
}  # fmt: skip


def held(
    estimator: Sampled, training: Training, step: float, rounds: int, seed: int
) -> list[float]:
    """Mean steps of the flights that ended in each round."""
    config = SwarmFile(
        name="sanity",
        agents=(AgentEntry("drone0", Task("sim:CartPoleVariant-v0")),),
        estimator=estimator,
        policy=Network(),
        training=training,
        optimizer=Adam(step=step),
        seed=seed,
    )
    learner = NeuralLearner(config, "drone0")
    theta, lengths = learner.initial(), []
    for round_ in range(rounds):
        done = learner.step(theta, round_)
        theta = theta + done.vector
        # Rewards are 1 a step, so the discounted return tells the length.
        lengths.append(np.log1p(-min(done.value, 99.4) * (1 - 0.99)) / np.log(0.99))
    learner.close()
    return [float(length) for length in lengths]


@pytest.mark.parametrize("kind", CASES)
def test_poles_are_held_up(kind: str) -> None:
    estimator, training, step, rounds, score = CASES[kind]
    for seed in SEEDS:
        lengths = held(estimator, training, step, rounds, seed)
        tenth = max(1, rounds // 10)
        best = max(np.convolve(lengths, np.ones(tenth) / tenth, "valid"))
        assert np.mean(lengths[:tenth]) < 60
        assert best > score, f"seed {seed}: {best:.0f} steps"
