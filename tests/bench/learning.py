"""One agent, end to end (render, policy, learning): ours and Stable-Baselines3's, side by side.

Same environment, same network (C3F2 with a value head), same batches, one thread, turn by turn in
one run.  Theirs computes as it comes, in float32; ours as it comes too, in bfloat16 where the CPU
has instructions for it.  The row between them is ours in float32.
"""

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import msgspec
import torch
from stable_baselines3 import A2C, PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import DummyVecEnv

from agent.config.experiment import SwarmFile, load
from agent.learning.estimators import ActorCritic
from agent.learning.networks import c3f2
from agent.learning.neural import NeuralLearner

SWARMS = Path(__file__).parents[2] / "deploy" / "library" / "swarms"
TURNS, STEPS = 3, 1024  # steps of a turn
KINDS = ("a2c", "ppo")


class Trunk(BaseFeaturesExtractor):  # type: ignore[misc]  # not installed but for benchmarks
    """C3F2's trunk, as Stable-Baselines3 takes it: pictures come transposed, from 0 to 1."""

    def __init__(self, space: gymnasium.spaces.Box) -> None:
        super().__init__(space, 1024)
        self.layers = c3f2()

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        features: torch.Tensor = self.layers(pictures)
        return features


def theirs(kind: str, config: SwarmFile) -> Callable[[], int]:
    """A function that learns from :data:`STEPS` steps and says how many there were."""
    training, estimator = config.training, config.estimator
    assert isinstance(estimator, ActorCritic)
    task = config.agents[0].task
    envs = DummyVecEnv([lambda: gymnasium.make(task.env, **task.kwargs)] * training.worlds)
    settings: dict[str, Any] = {
        "policy": "CnnPolicy",
        "env": envs,
        "n_steps": training.segment,
        "gamma": estimator.gamma,
        "gae_lambda": estimator.trace,
        "learning_rate": 1e-4,
        "policy_kwargs": {"features_extractor_class": Trunk, "net_arch": []},
        "device": "cpu",
    }
    learner: PPO | A2C
    if kind == "ppo":
        batch = training.minibatch
        learner = PPO(batch_size=batch, n_epochs=estimator.epochs, **settings)
    else:
        learner = A2C(use_rms_prop=False, **settings)

    def turn() -> int:
        before = learner.num_timesteps
        learner.learn(STEPS, reset_num_timesteps=before == 0)
        return int(learner.num_timesteps - before)

    return turn


def ours(config: SwarmFile, compute: str) -> Callable[[], int]:
    """The same of ours."""
    policy = msgspec.structs.replace(config.policy, compute=compute)
    learner = NeuralLearner(msgspec.structs.replace(config, policy=policy), config.members[0])
    theta, round_ = learner.initial(), 0

    def turn() -> int:
        nonlocal theta, round_
        steps = 0
        while steps < STEPS:
            step = learner.step(theta, round_)
            theta, round_, steps = theta + step.vector, round_ + 1, steps + step.steps
        return steps

    return turn


def rate(turn: Callable[[], int]) -> float:
    """Steps per CPU-second."""
    begun = time.process_time()
    return turn() / (time.process_time() - begun)


def main() -> None:
    """Print steps per CPU-second and ratios."""
    torch.set_num_threads(1)
    print("learning: steps per CPU-second of one agent, C3F2, render + policy + learning")
    for kind in KINDS:
        config = load(SWARMS / f"drones-{kind}.toml")
        if kind == "a2c":  # theirs takes a round in one optimiser step
            training = msgspec.structs.replace(config.training, minibatch=0)
            config = msgspec.structs.replace(config, training=training)
        peers = {
            "ours": ours(config, "auto"),
            "ours, float32": ours(config, "float32"),
            "Stable-Baselines3": theirs(kind, config),
        }
        rates: dict[str, list[float]] = {name: [] for name in peers}
        for _ in range(TURNS):
            for name, turn in peers.items():
                rates[name].append(rate(turn))
        middle = {name: statistics.median(list_) for name, list_ in rates.items()}
        reference = middle["Stable-Baselines3"]
        for name, value in middle.items():
            print(f"  {kind:4} {name:18} {value:6.0f}  {value / reference:5.2f} x")


if __name__ == "__main__":
    main()
