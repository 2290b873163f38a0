"""What observations and actions may be: learned from as they are, or refused before the start."""

from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest
from gymnasium import spaces

from agent.config.experiment import AgentEntry, SwarmFile, Task, Training
from agent.errors import TaskError
from agent.learning.estimators import A2C
from agent.learning.neural import NeuralLearner
from agent.learning.policies import Network
from deploy.launch.preparation import check_tasks


class Sampler(gymnasium.Env[Any, Any]):
    """Observes whatever its space draws, for four steps; takes only actions of its space."""

    def __init__(self, observed: spaces.Space[Any], acts: spaces.Space[Any]) -> None:
        self.observation_space, self.action_space, self.t = observed, acts, 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        self.t = 0
        return self.observation_space.sample(), {}

    def step(self, action: Any) -> Any:
        assert self.action_space.contains(action)
        self.t += 1
        return self.observation_space.sample(), 1.0, self.t == 4, False, {}


def make(**spaces_of: Any) -> Sampler:
    return Sampler(**spaces_of)


gymnasium.register("Spaces-v0", make, disable_env_checker=True)
TWO = spaces.Discrete(2)


def swarm(observed: spaces.Space[Any], acts: spaces.Space[Any] = TWO) -> SwarmFile:
    task = Task("Spaces-v0", {"observed": observed, "acts": acts})
    return SwarmFile(
        name="spaces",
        agents=(AgentEntry("a", task), AgentEntry("b", task)),
        estimator=A2C(),
        policy=Network((4,)),
        training=Training(segment=6, worlds=2),
    )


@pytest.mark.parametrize(
    ("observed", "acts"),
    [
        (spaces.Box(-1, 1, ()), TWO),
        (spaces.Box(-1, 1, (3,)), spaces.Discrete(3, start=1)),
        (spaces.Box(-1, 1, (3,)), spaces.Discrete(3, start=-5)),
        (spaces.Box(-1, 1, (2, 3), np.float64), TWO),
        (spaces.Box(0, 9, (5,), np.int64), TWO),
        (spaces.Box(0, 1, (4,), np.int8), TWO),
        (spaces.Box(0, 255, (7, 7, 3), np.uint8), TWO),
        (spaces.Box(0, 255, (84, 84), np.uint8), TWO),
        (spaces.Box(0, 255, (4,), np.uint8), TWO),
    ],
    ids=str,
)
def test_these_are_learned_from(observed: spaces.Space[Any], acts: spaces.Space[Any]) -> None:
    config = swarm(observed, acts)
    check_tasks(config)
    learner = NeuralLearner(config, "a")
    step = learner.step(learner.initial(), 0)
    learner.close()
    assert step.steps == 12
    assert np.isfinite(step.vector).all()


@pytest.mark.parametrize(
    ("observed", "acts", "words"),
    [
        (spaces.Discrete(4), TWO, "expected a Box space"),
        (spaces.Dict({"a": spaces.Box(0, 1, (2,))}), TWO, "expected a Box space"),
        (spaces.Box(0, 1, (0,)), TWO, "expected a Box space"),
        (spaces.Box(0, 255, (3, 84, 84), np.uint8), TWO, "expected channels last, (84, 84, 3)"),
        (spaces.Box(-1, 1, (2,)), spaces.Box(-1, 1, (2,)), "expected a Discrete space"),
        (spaces.Box(-1, 1, (2,)), spaces.MultiDiscrete([2, 2]), "expected a Discrete space"),
    ],
    ids=str,
)
def test_these_are_refused_before_the_start(
    observed: spaces.Space[Any], acts: spaces.Space[Any], words: str
) -> None:
    with pytest.raises(TaskError) as error:
        check_tasks(swarm(observed, acts))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_whole_flights_take_the_tasks_own_actions_too() -> None:
    config = swarm(spaces.Box(-1, 1, ()), spaces.Discrete(2, start=1))
    config = msgspec.structs.replace(config, training=Training())
    learner = NeuralLearner(config, "b")
    assert learner.step(learner.initial(), 0).episodes == 1
    learner.close()
