"""Learning in a finite world whose model can be asked for: exact, or from sampled episodes.

Needs no torch: an agent of this kind takes some 50 MB.  The randomness of a round is a function
of (seed, agent, round) alone, so a resumed agent, a slow one and a simulated one see the same
episodes.
"""

from collections.abc import Callable
from math import prod
from typing import Any, Protocol, Self, cast

import gymnasium
import numpy as np
from numpy.typing import NDArray

from agent.config.experiment import SwarmFile
from agent.errors import TaskError
from agent.learning.estimators import ActorCritic, Exact, Sampled
from agent.learning.learner import Attendance, Step, Vector
from agent.learning.optimizers import Ascent
from agent.learning.policies import Table, entropy_gradient, score_sum, softmax, table_rows
from agent.learning.returns import generalized_advantages, rewards_to_go


class Episodes(Protocol):
    """Sampled episodes, time first: (T, *B, E) arrays, B empty for one agent.

    ``active`` tells which steps were taken; ``last_states`` (*B, E) where the episodes ended,
    ``terminated`` whether they did so by themselves.
    """

    @property
    def states(self) -> NDArray[np.intp]: ...
    @property
    def actions(self) -> NDArray[np.intp]: ...
    @property
    def rewards(self) -> NDArray[np.float64]: ...
    @property
    def active(self) -> NDArray[np.bool_]: ...
    @property
    def terminated(self) -> NDArray[np.bool_]: ...
    @property
    def last_states(self) -> NDArray[np.intp]: ...


class FiniteModel(Protocol):
    """What a task's ``env.unwrapped.model`` must offer to be learned in a table."""

    @property
    def n_states(self) -> int: ...
    @property
    def n_actions(self) -> int: ...
    @property
    def start(self) -> NDArray[np.float64]: ...
    @property
    def terminal(self) -> NDArray[np.bool_]: ...

    def value(self, policy: Table) -> float: ...
    def gradient(self, policy: Table, entropy_weight: float) -> Table: ...
    def sample(self, policy: Table, uniforms: NDArray[np.float64]) -> Episodes: ...
    def most_followed_path(self, policy: Table) -> list[int]: ...
    def with_start(self, start: NDArray[np.float64]) -> Self: ...


def build_model(config: SwarmFile, agent: str) -> FiniteModel:
    """The finite model of an agent's task, with the estimator's discount.

    Raises:
        TaskError: the environment is unknown, refuses its arguments or has no model.
    """
    task = config.agents[config.index(agent)].task
    kwargs: dict[str, Any] = {"gamma": config.estimator.gamma} | task.kwargs
    try:
        env = gymnasium.make(task.env, **kwargs)
    except (gymnasium.error.Error, TypeError, ValueError, KeyError, ImportError) as error:
        raise TaskError(f'agent "{agent}": task "{task.env}" cannot be made: {error}') from None
    model = getattr(env.unwrapped, "model", None)
    if model is None:
        raise TaskError(
            f'agent "{agent}": task "{task.env}" has no finite model: '
            'expected one for policy.kind = "tabular", e.g. sim:GridWorld-v0'
        )
    return cast(FiniteModel, model)


def draw_uniforms(
    seed: int, agent: int, round_: int, episodes: int, horizon: int
) -> NDArray[np.float64]:
    """(horizon + 1, episodes, 2) numbers in [0, 1): all chance of one agent's round."""
    rng = np.random.default_rng((seed, agent, round_))
    return rng.random((horizon + 1, episodes, 2))


def policy_gradient(
    policy: Table, episodes: Episodes, weights: Table, entropy_weight: float
) -> Table:
    """Mean over episodes of ``sum_t w_t grad log pi(a_t | s_t)``, plus the regulariser's gradient.

    Args:
        policy: (*B, S, A) probabilities of one agent (B empty) or of many at once.
        episodes: what they did, in (T, *B, E) arrays.
        weights: (T, *B, E) the w_t, 0 for steps that were not taken.
        entropy_weight: lambda.
    """
    score = score_sum(policy, episodes.states, episodes.actions, weights)
    return np.asarray(score / weights.shape[-1] + entropy_weight * entropy_gradient(policy))


def value_gradient(values: Table, episodes: Episodes, targets: Table) -> Table:
    """(*B, S) mean error of the critic's ``values`` over the visits of each state.

    The mean, not the sum: a state where episodes go round and round needs no smaller step then.
    """
    rows = table_rows(values.shape, episodes.states)
    errors = np.where(episodes.active, targets - values.ravel()[rows], 0.0)
    sums = np.bincount(rows.ravel(), errors.ravel(), values.size)
    visits = np.bincount(rows.ravel(), episodes.active.ravel(), values.size)
    return np.asarray((sums / np.maximum(visits, 1)).reshape(values.shape))


def gains(values: Table, episodes: Episodes, estimator: Sampled) -> Table:
    """(T, *B, E) what each step was good for: returns, or advantages where there is a critic."""
    if not isinstance(estimator, ActorCritic):
        return rewards_to_go(episodes.rewards, estimator.gamma)
    flat = values.ravel()
    ahead = flat[table_rows(values.shape, episodes.last_states)]
    return generalized_advantages(
        episodes.rewards,
        flat[table_rows(values.shape, episodes.states)],
        np.where(episodes.terminated, 0.0, ahead),
        episodes.active,
        estimator.gamma,
        estimator.trace,
    )


def sampled_step(
    theta: Vector,
    policy: Table,
    episodes: Episodes,
    estimator: Sampled,
    ascend: Callable[[Vector], Vector],
) -> tuple[Vector, Table]:
    """A round's step from its episodes, for one agent (B empty) or for many at once.

    Args:
        theta: (*B, d) parameters: logits, then the critic's values if the estimator has one.
        policy: (*B, S, A) the softmax of these logits, which flew the episodes.
        episodes: with (T, *B, E) arrays.
        estimator: its settings.
        ascend: the optimiser.

    Returns:
        (*B, d) the step, summed over the estimator's epochs, and the first gradient estimate.
    """
    split = policy.shape[-2] * policy.shape[-1]
    values = theta[..., split:].astype(np.float64)
    gain = gains(values, episodes, estimator)
    targets, weighted = gain, gain
    if isinstance(estimator, ActorCritic):
        rows = table_rows(policy.shape[:-1], episodes.states)
        targets = gain + values.ravel()[rows]
        cells = rows * policy.shape[-1] + episodes.actions
    if estimator.discount_visits:
        powers = estimator.gamma ** np.arange(len(gain))
        weighted = gain * powers.reshape(-1, *[1] * (gain.ndim - 1))
    total, first = None, None
    for _ in range(estimator.epochs):
        at = theta if total is None else theta + total
        here = policy if total is None else softmax(at[..., :split].reshape(policy.shape))
        ratio = 1.0 if total is None else here.ravel()[cells] / policy.ravel()[cells]
        weights = estimator.weight(ratio, weighted)
        gradient = policy_gradient(here, episodes, weights, estimator.entropy_weight)
        gradient = gradient.reshape(at[..., :split].shape)
        if isinstance(estimator, ActorCritic):
            pull = value_gradient(at[..., split:].astype(np.float64), episodes, targets)
            gradient = np.concatenate([gradient, estimator.value_weight * pull], axis=-1)
        step = ascend(gradient.astype(theta.dtype))
        total, first = (step, gradient) if total is None else (total + step, first)
    assert total is not None and first is not None
    return total, first


def anywhere(model: FiniteModel, share: float) -> FiniteModel:
    """The model, with ``share`` of its start distribution spread evenly over its live states."""
    live = ~model.terminal
    return model.with_start((1 - share) * model.start + share * live / live.sum())


def parts_of(config: SwarmFile, model: FiniteModel) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Names and shapes of what makes up theta: the logits, and the values of a critic."""
    logits = ("logits", (model.n_states, model.n_actions))
    if isinstance(config.estimator, ActorCritic):
        return (logits, ("values", (model.n_states,)))
    return (logits,)


class TabularLearner:
    """Softmax table in a finite model; see :class:`agent.learning.learner.Learner`.

    Args:
        config: the swarm file.
        agent: id of the agent.
    """

    def __init__(self, config: SwarmFile, agent: str) -> None:
        self._config, self._agent = config, config.index(agent)
        self._model = build_model(config, agent)
        self._anywhere = anywhere(self._model, config.start_mixing.uniform)
        self._ascent = Ascent(config.optimizer)
        self.attendance = Attendance()
        self._shape = (self._model.n_states, self._model.n_actions)

    @property
    def parts(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        return parts_of(self._config, self._model)

    @property
    def optimizer_state(self) -> dict[str, Vector]:
        return self._ascent.state

    def initial(self) -> Vector:
        size = sum(prod(shape) for _, shape in self.parts)
        return np.zeros(size, self._config.policy.precision)

    def step(self, theta: Vector, round_: int) -> Step:
        config, estimator = self._config, self._config.estimator
        policy = self._policy(theta)
        self._ascent.config = config.optimizer_at(round_)
        model = self._anywhere if round_ < config.start_mixing.rounds else self._model
        if isinstance(estimator, Exact):
            gradient = model.gradient(policy, estimator.entropy_weight).reshape(-1)
            vector = self._ascent.step(gradient.astype(theta.dtype))
            return Step(vector, model.value(policy), 0, 0, float(np.linalg.norm(gradient)))
        uniforms = draw_uniforms(
            config.seed, self._agent, round_, estimator.episodes, estimator.horizon
        )
        flown = model.sample(policy, uniforms)
        vector, gradient = sampled_step(theta, policy, flown, estimator, self._ascent.step)
        discounts = estimator.gamma ** np.arange(len(flown.rewards))
        value = float(discounts @ flown.rewards.mean(axis=1))
        steps = int(flown.active.sum())
        return Step(vector, value, estimator.episodes, steps, float(np.linalg.norm(gradient)))

    def route(self, theta: Vector) -> tuple[int, ...]:
        return tuple(self._model.most_followed_path(self._policy(theta)))

    def close(self) -> None:
        """A table holds nothing."""

    def _policy(self, theta: Vector) -> Table:
        return softmax(theta[: prod(self._shape)].reshape(self._shape))
