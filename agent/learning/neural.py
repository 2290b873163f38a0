"""Learning with a network, from flights: REINFORCE, A2C and PPO.

A round flies (:mod:`agent.learning.rollout`), weighs every step as the estimator says, and climbs
in one or several optimiser steps at the agent's own parameters.  Their sum is what the swarm adds
to the mixed parameters; with ``estimator.mix_critic = false`` the value head keeps its own instead.
Objective per step of a flight, with ``w`` from the estimator:

    w log pi(a|s)  +  lambda mean_a log pi(a|s)  -  value_weight (target - V(s))^2

The second term is minus the relative entropy of Eq. 9, over the states that were visited.  With
whole episodes, a round is a function of (parameters, round, seed, optimiser state) alone; segments
also go on with the flights of the round before, and begin new ones after a restart.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Discrete
from gymnasium.wrappers import TransformAction
from numpy.typing import NDArray
from torch import Tensor

from agent.config.experiment import SwarmFile
from agent.errors import TaskError
from agent.learning.estimators import ActorCritic, Exact
from agent.learning.flat import FlatAscent, FlatNetwork, Parts
from agent.learning.learner import Attendance, Step, Stopped, Vector
from agent.learning.networks import Pictures, build
from agent.learning.policies import Tabular
from agent.learning.returns import generalized_advantages, rewards_to_go
from agent.learning.rollout import Choice, Ended, Observations, Stretch, Worlds

AT_ONCE = 64  # pictures in memory with all that their derivatives need; more are no faster
VECTORS_AT_ONCE = 4096


@dataclass(frozen=True, slots=True)
class _Samples:
    """The T steps of a round: what was seen, done, thought of it, and what it was good for."""

    observations: list[NDArray[Any]]
    actions: Tensor
    before: Tensor  # log-probabilities when it was done
    gain: Tensor
    target: Tensor


def make_world(config: SwarmFile, agent: str) -> gymnasium.Env[Any, Any]:
    """The world of an agent's task; its actions count from 0, whatever the task's own begin with.

    Raises:
        TaskError: the environment is unknown or refuses its arguments.
    """
    task = config.agents[config.index(agent)].task
    try:
        world = gymnasium.make(task.env, **task.kwargs)
    except (gymnasium.error.Error, TypeError, ValueError, KeyError, ImportError) as error:
        raise TaskError(f'agent "{agent}": task "{task.env}" cannot be made: {error}') from None
    actions = world.action_space
    if not isinstance(actions, Discrete) or actions.start == 0:
        return world
    first = actions.start
    return TransformAction(world, lambda action: first + action, Discrete(actions.n))


class NeuralLearner:
    """A network in Gymnasium worlds; see :class:`agent.learning.learner.Learner`.

    Args:
        config: the swarm file, with a policy of the kinds ``network`` or ``c3f2``.
        agent: id of the agent.

    Raises:
        TaskError: the world cannot be made, or its spaces do not fit the policy.
    """

    def __init__(self, config: SwarmFile, agent: str) -> None:
        policy, estimator = config.policy, config.estimator
        assert not isinstance(policy, Tabular)
        assert not isinstance(estimator, Exact)
        torch.set_num_threads(config.training.threads)
        if policy.device == "cuda" and not torch.cuda.is_available():
            raise TaskError('policy.device = "cuda": this machine has none; expected "cpu"')
        self._config, self._estimator, self._agent = config, estimator, config.index(agent)
        first = make_world(config, agent)
        critic = isinstance(estimator, ActorCritic)
        spaces = first.observation_space, first.action_space
        try:
            network = build(policy, *spaces, critic, config.seed)
        except TaskError as error:
            first.close()
            raise TaskError(f'agent "{agent}": {error}') from None
        self._flat = FlatNetwork(network)
        self._initial = self._flat.theta.cpu().numpy().copy()
        self._size = sum(prod(shape) for _, shape in self.parts)
        others = [make_world(config, agent) for _ in range(config.training.worlds - 1)]
        self._worlds = Worlds([first, *others], estimator.gamma, estimator.horizon)
        self._random = np.random.default_rng(0)
        self._last = Ended(0.0, 0, None)
        self.optimizer_state: dict[str, Vector] = {}

    @property
    def attendance(self) -> Attendance:
        return self._worlds.attendance

    @attendance.setter
    def attendance(self, attendance: Attendance) -> None:
        self._worlds.attendance = attendance

    @property
    def parts(self) -> Parts:
        return tuple(part for part in self._flat.parts if self._travels(part[0]))

    def _travels(self, name: str) -> bool:
        return self._config.mixes_critic or not name.startswith("value.")

    def initial(self) -> Vector:
        return self._initial[: self._size].copy()

    def route(self, theta: Vector) -> tuple[int, ...]:
        """Empty: nobody knows where a network would lead."""
        return ()

    def close(self) -> None:
        self._worlds.close()

    def step(self, theta: Vector, round_: int) -> Step:
        training = self._config.training
        self._random = np.random.default_rng((self._config.seed, self._agent, round_))
        own = self.optimizer_state.get("critic", self._initial[self._size :])
        self._flat.load(np.concatenate([theta, own]))
        seeds = self._random.integers(2**31, size=training.worlds)
        if not training.segment:
            stretches, ended = self._worlds.episodes(self._act, self._estimator.episodes, seeds)
        elif isinstance(self._estimator, ActorCritic):
            stretches, ended = self._worlds.segment(self._act, training.segment, seeds)
        else:
            steps = training.worlds * training.segment
            stretches, ended = self._worlds.flights(self._act, steps, seeds)
        length = self._learn(stretches, round_)
        if ended:
            distances = [flight.distance for flight in ended if flight.distance is not None]
            self._last = Ended(
                float(np.mean([flight.value for flight in ended])),
                sum(flight.steps for flight in ended),
                float(np.mean(distances)) if distances else None,
            )
        learned = self._flat.theta.cpu().numpy()
        if own.size:
            self.optimizer_state["critic"] = learned[self._size :].copy()
        return Step(
            vector=learned[: self._size] - theta,
            value=self._last.value,
            episodes=len(ended),
            steps=sum(len(stretch.rewards) for stretch in stretches),
            gradient_norm=length,
            distance=self._last.distance,
        )

    def _act(self, observations: Observations) -> Choice:
        """Sample an action for every observation."""
        return self._flat.choose(observations, self._random.random(len(observations)))

    def _learn(self, stretches: list[Stretch], round_: int) -> float:
        """Climb; returns the length of the first gradient."""
        estimator, training = self._estimator, self._config.training
        gains, targets = self._gains(stretches)
        if training.standardize:
            gains = (gains - gains.mean()) / (gains.std() + 1e-8)
        if estimator.discount_visits:
            at = [s.start + t for s in stretches for t in range(len(s.rewards))]
            gains = gains * estimator.gamma ** np.array(at)
        samples = _Samples(
            observations=[o for s in stretches for o in s.observations],
            actions=self._tensor(np.array([a for s in stretches for a in s.actions])),
            before=self._tensor(np.array([p for s in stretches for p in s.log_probs], np.float32)),
            gain=self._tensor(gains.astype(np.float32)),
            target=self._tensor(targets.astype(np.float32)),
        )
        ascent = FlatAscent(self._config.optimizer_at(round_), self._flat, self.optimizer_state)
        count = len(samples.observations)
        parts = max(1, round(count / training.minibatch)) if training.minibatch else 1
        first = None
        for _ in range(estimator.epochs):
            order = self._random.permutation(count) if parts > 1 else np.arange(count)
            for rows in np.array_split(order, parts):
                if self.attendance.stopped():
                    raise Stopped
                length = self._flat.differentiate(
                    self._objectives(samples, rows), training.gradient_clip
                )
                first = length if first is None else first
                ascent.step()
        self.optimizer_state = ascent.state()
        return first or 0.0

    def _objectives(self, samples: _Samples, rows: NDArray[np.int64]) -> Iterator[Tensor]:
        """Mean over the steps ``rows`` of what climbs (module docstring), as a sum of parts."""
        pictures = isinstance(self._flat.network.eyes, Pictures)
        at_once = AT_ONCE if pictures else VECTORS_AT_ONCE
        for some in np.array_split(rows, -(-len(rows) // at_once)):
            yield self._objective(samples, some) * (len(some) / len(rows))

    def _objective(self, samples: _Samples, rows: NDArray[np.int64]) -> Tensor:
        estimator, which = self._estimator, self._tensor(rows)
        seen = self._tensor(np.stack([samples.observations[i] for i in rows]))
        logits, values = self._flat.network(seen)
        log_policy = torch.log_softmax(logits, -1)
        log_probs = log_policy.gather(1, samples.actions[which, None]).squeeze(1)
        ratio = (log_probs.detach() - samples.before[which]).exp()
        objective: Tensor = (estimator.weight(ratio, samples.gain[which]) * log_probs).mean()
        objective = objective + estimator.entropy_weight * log_policy.mean()
        if isinstance(estimator, ActorCritic):
            errors = samples.target[which] - values
            objective = objective - estimator.value_weight * errors.square().mean()
        return objective

    def _gains(self, stretches: list[Stretch]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(T,) what every step was good for, and (T,) what the critic should have said."""
        estimator, scale = self._estimator, self._config.training.reward_scale
        rewards = [np.array(s.rewards) * scale for s in stretches]
        if not isinstance(estimator, ActorCritic):
            returns = np.concatenate([rewards_to_go(r, estimator.gamma) for r in rewards])
            return returns, returns
        gains = []
        for r, s, last in zip(rewards, stretches, self._ahead(stretches), strict=True):
            values, everywhere = np.array(s.values), np.ones(len(r), np.bool_)
            gains.append(
                generalized_advantages(
                    r, values, last, everywhere, estimator.gamma, estimator.trace
                )
            )
        flat = np.concatenate(gains)
        return flat, flat + np.concatenate([s.values for s in stretches])

    def _ahead(self, stretches: list[Stretch]) -> NDArray[np.float64]:
        """(N,) value after the last step of each stretch; 0 where the flight ended by itself."""
        ahead = np.zeros(len(stretches))
        last = {i: s.last for i, s in enumerate(stretches) if s.last is not None}
        if last:
            with torch.inference_mode():
                values = self._flat.network(self._tensor(np.stack(list(last.values()))))[1]
            ahead[list(last)] = values.cpu().numpy()
        return ahead

    def _tensor(self, array: NDArray[Any]) -> Tensor:
        return torch.from_numpy(array).to(self._flat.device)
