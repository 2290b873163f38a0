"""The neural learner against the tabular one, and against itself."""

from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest
import torch
from gymnasium import spaces

import sim  # noqa: F401  (registers the worlds)
from agent.config.experiment import AgentEntry, SwarmFile, Task, Training
from agent.errors import TaskError
from agent.learning.estimators import A2C, PPO, Reinforce, Sampled
from agent.learning.learners import build_learner
from agent.learning.moments import MixedMoments
from agent.learning.neural import NeuralLearner
from agent.learning.optimizers import Adam, Optimizer, Sgd
from agent.learning.policies import Network

WHOLE = Training()
ADAM = Adam(step=1e-3)
SMALL = Network()
CARTPOLE = Task("sim:CartPoleVariant-v0", {"gravity": 12.0})


def config(
    estimator: Sampled,
    training: Training = WHOLE,
    optimizer: Optimizer = ADAM,
    task: Task = CARTPOLE,
    policy: Network = SMALL,
) -> SwarmFile:
    return SwarmFile(
        name="test",
        agents=(AgentEntry("drone0", task),),
        estimator=estimator,
        policy=policy,
        training=training,
        optimizer=optimizer,
    )


class Switch(gymnasium.Env[Any, Any]):
    """Two steps; the first action chooses the reward of the second. States as unit vectors."""

    observation_space = spaces.Box(0, 1, (3,), np.float32)
    action_space = spaces.Discrete(2)

    state = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        self.state = 0
        return np.eye(3, dtype=np.float32)[0], {}

    def step(self, action: int) -> Any:
        if self.state == 0:
            self.state = 1 + action
            return np.eye(3, dtype=np.float32)[self.state], 0.0, False, False, {}
        reward = float(self.state == 2)
        self.state = 0
        return np.eye(3, dtype=np.float32)[0], reward, True, False, {}


if "Switch-v0" not in gymnasium.registry:
    gymnasium.register("Switch-v0", entry_point=lambda **kwargs: Switch())


def test_reinforce_is_the_policy_gradient_of_a_table() -> None:
    """With unit vectors and no hidden layer the logits are a table; its gradient is known."""
    estimator = Reinforce(gamma=0.9, entropy_weight=0.0, episodes=4000)
    learner = NeuralLearner(
        config(
            estimator,
            Training(worlds=50),
            Sgd(step=1.0),
            Task("Switch-v0"),
            Network(hidden=()),
        ),
        "drone0",
    )
    theta = np.zeros(8, np.float32)  # weight (2, 3), bias (2,)
    step = learner.step(theta, 0)
    weight = step.vector[:6].reshape(2, 3)
    # Uniform policy: G_0 = 0.9 with action 1, else 0.  E[G_0 (1[a] - 1/2)] = +-0.225, and half the
    # steps are first ones.  In states 1 and 2 both actions are worth the same.
    np.testing.assert_allclose(weight[:, 0], [-0.1125, 0.1125], atol=0.01)
    np.testing.assert_allclose(weight[:, 1:], 0, atol=0.01)
    assert step.value == pytest.approx(0.45, abs=0.03)
    assert (step.episodes, step.steps) == (4000, 8000)
    learner.close()


@pytest.mark.parametrize(
    ("estimator", "training"),
    [
        (Reinforce(episodes=3), Training(worlds=2)),
        (Reinforce(), Training(worlds=2, segment=32, standardize=True, minibatch=16)),
        (A2C(trace=0.9), Training(worlds=2, segment=16, gradient_clip=0.5)),
        (PPO(episodes=2, epochs=2), Training(worlds=2, minibatch=8, reward_scale=0.1)),
    ],
)
def test_a_round_is_a_function_of_seed_and_parameters(
    estimator: Sampled, training: Training
) -> None:
    def learn() -> tuple[Any, ...]:
        learner = build_learner(config(estimator, training), "drone0")
        theta = learner.initial()
        for round_ in range(3):
            step = learner.step(theta, round_)
            theta = theta + step.vector
        learner.close()
        return theta, step, learner.optimizer_state

    (one, step, state), (other, _, _) = learn(), learn()
    np.testing.assert_array_equal(one, other)
    assert np.isfinite(one).all()
    assert step.steps > 0
    assert state["count"][0] >= 3


def test_whole_episodes_depend_on_nothing_flown_before() -> None:
    settings = config(PPO(episodes=4, epochs=2), Training(worlds=2))
    fresh, used = NeuralLearner(settings, "drone0"), NeuralLearner(settings, "drone0")
    theta = fresh.initial()
    used.step(theta, 0)
    used.optimizer_state = {}
    np.testing.assert_array_equal(fresh.step(theta, 7).vector, used.step(theta, 7).vector)


def test_decay_makes_late_steps_smaller() -> None:
    whole, falling = (
        msgspec.structs.replace(
            config(A2C(), Training(segment=20), Sgd(step=0.1, decay=decay)), rounds=10
        )
        for decay in (0.0, 1.0)
    )
    steps = [NeuralLearner(settings, "drone0") for settings in (whole, falling)]
    theta = steps[0].initial()
    ours, shorter = (learner.step(theta, 8).vector for learner in steps)
    assert np.linalg.norm(shorter) == pytest.approx(0.2 * np.linalg.norm(ours), rel=1e-3)


def test_the_first_step_of_ppo_is_that_of_a2c() -> None:
    """One epoch, one minibatch, ratio 1: nothing is clipped."""
    training = Training(worlds=2, segment=20)
    one = NeuralLearner(config(PPO(epochs=1, trace=0.9), training), "drone0")
    other = NeuralLearner(config(A2C(trace=0.9), training), "drone0")
    theta = one.initial()
    np.testing.assert_allclose(one.step(theta, 0).vector, other.step(theta, 0).vector, atol=1e-6)


def test_moments_travel_when_asked_to() -> None:
    optimizer = Adam(step=1e-3, mix_moments=True)
    settings = config(A2C(), Training(worlds=2, segment=16), optimizer)
    learner = build_learner(settings, "drone0")
    assert isinstance(learner, MixedMoments)
    alone = NeuralLearner(msgspec.structs.replace(settings, optimizer=ADAM), "drone0")
    theta, plain = learner.initial(), alone.initial()
    size = plain.size
    assert [name for name, _ in learner.parts][-2:] == ["adam.first", "adam.second"]
    assert theta.size == 3 * size
    for round_ in range(2):
        theta = theta + learner.step(theta, round_).vector
        plain = plain + alone.step(plain, round_).vector
    # Mixed with nobody, it is what an agent alone has.
    np.testing.assert_allclose(theta[:size], plain, atol=1e-6)
    np.testing.assert_allclose(theta[size : 2 * size], alone.optimizer_state["first"], atol=1e-6)
    # A neighbour's moments steer the step.
    moved = theta.copy()
    moved[size : 2 * size] += 0.1
    assert not np.allclose(
        build_learner(settings, "drone0").step(theta, 5).vector[:size],
        _with_count(learner, moved)[:size],
    )


def test_a_critic_that_does_not_travel_learns_at_home() -> None:
    training = Training(worlds=2, segment=16)
    settings = config(A2C(trace=0.9, mix_critic=False), training)
    learner = NeuralLearner(settings, "drone0")
    plain = NeuralLearner(config(A2C(trace=0.9), training), "drone0")
    theta, whole = learner.initial(), plain.initial()
    size = theta.size
    assert size == sum(int(np.prod(shape)) for _, shape in learner.parts)
    assert [name for name, _ in plain.parts if name not in dict(learner.parts)] == [
        "value.weight",
        "value.bias",
    ]
    for round_ in range(2):
        theta = theta + learner.step(theta, round_).vector
        whole = whole + plain.step(whole, round_).vector
    # Mixed with nobody, it is what an agent alone has.
    np.testing.assert_array_equal(theta, whole[:size])
    np.testing.assert_array_equal(learner.optimizer_state["critic"], whole[size:])
    # And it is what the next step goes by.
    kept = dict(learner.optimizer_state)
    ours = learner.step(theta, 2).vector
    other = NeuralLearner(settings, "drone0")
    other.optimizer_state = kept | {"critic": kept["critic"] + 1}
    assert not np.allclose(other.step(theta, 2).vector, ours)


def _with_count(learner: MixedMoments, theta: Any) -> Any:
    return learner.step(theta, 5).vector


def test_a_task_that_does_not_fit_is_named() -> None:
    with pytest.raises(TaskError, match='agent "drone0": task "Nowhere-v0" cannot be made'):
        NeuralLearner(config(A2C(), task=Task("Nowhere-v0")), "drone0")
    with pytest.raises(TaskError, match='agent "drone0": observations are Discrete'):
        NeuralLearner(
            config(A2C(), task=Task("sim:GridWorld-v0", {"layout": "a", "task": 0})), "drone0"
        )


def test_a_missing_gpu_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(TaskError, match=r'policy.device = "cuda"'):
        NeuralLearner(config(A2C(), policy=Network(device="cuda")), "drone0")
