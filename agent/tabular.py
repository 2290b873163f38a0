"""Learning in a finite world whose model can be asked for: exact, or from sampled episodes.

Needs no torch: an agent of this kind takes some 50 MB.  The randomness of a round is a function
of (seed, agent, round) alone, so a resumed agent, a slow one and a simulated one see the same
episodes.
"""

from typing import Any, Protocol, Self, cast

import gymnasium
import numpy as np
from numpy.typing import NDArray

from agent.config import SwarmFile
from agent.errors import TaskError
from agent.estimators import Estimator, Exact
from agent.learner import Step, Vector
from agent.optimizers import Ascent
from agent.policies import Table, entropy_gradient, score_sum, softmax
from agent.returns import rewards_to_go


class Episodes(Protocol):
    """Sampled episodes, time first: (T, E) arrays; ``active`` tells which steps were taken."""

    @property
    def states(self) -> NDArray[np.intp]: ...
    @property
    def actions(self) -> NDArray[np.intp]: ...
    @property
    def rewards(self) -> NDArray[np.float64]: ...
    @property
    def active(self) -> NDArray[np.bool_]: ...


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


def monte_carlo_gradient(policy: Table, episodes: Episodes, estimator: Estimator) -> Table:
    """Mean over episodes of ``sum_t w_t grad log pi(a_t | s_t)``, plus the regulariser's gradient.

    Args:
        policy: (S, A) probabilities that flew the episodes.
        episodes: what they did.
        estimator: decides the weights w_t.
    """
    assert not isinstance(estimator, Exact)
    weights = rewards_to_go(episodes.rewards, estimator.gamma)
    if estimator.discount_visits:
        weights *= estimator.gamma ** np.arange(len(weights))[:, None]
    taken = episodes.active
    score = score_sum(policy, episodes.states[taken], episodes.actions[taken], weights[taken])
    return np.asarray(
        score / episodes.rewards.shape[1] + estimator.entropy_weight * entropy_gradient(policy)
    )


class TabularLearner:
    """Softmax table in a finite model; see :class:`agent.learner.Learner`.

    Args:
        config: the swarm file.
        agent: id of the agent.
    """

    def __init__(self, config: SwarmFile, agent: str) -> None:
        self._config, self._agent = config, config.index(agent)
        self._model = build_model(config, agent)
        self._ascent = Ascent(config.optimizer)
        self._dtype = np.dtype(config.policy.precision)
        self._shape = (self._model.n_states, self._model.n_actions)
        self._anywhere = self._mixed_start()

    def _mixed_start(self) -> FiniteModel:
        """The model with the start distribution of the first ``start_mixing.rounds`` rounds."""
        live = ~self._model.terminal
        share = self._config.start_mixing.uniform
        return self._model.with_start((1 - share) * self._model.start + share * live / live.sum())

    @property
    def parts(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        return (("logits", self._shape),)

    @property
    def optimizer_state(self) -> dict[str, Vector]:
        return self._ascent.state

    def initial(self) -> Vector:
        return np.zeros(self._shape[0] * self._shape[1], self._dtype)

    def step(self, theta: Vector, round_: int) -> Step:
        config, estimator = self._config, self._config.estimator
        policy = softmax(theta.reshape(self._shape))
        model = self._anywhere if round_ < config.start_mixing.rounds else self._model
        if isinstance(estimator, Exact):
            value, episodes, steps = model.value(policy), 0, 0
            gradient = model.gradient(policy, estimator.entropy_weight)
        else:
            uniforms = draw_uniforms(
                config.seed, self._agent, round_, estimator.episodes, estimator.horizon
            )
            flown = model.sample(policy, uniforms)
            gradient = monte_carlo_gradient(policy, flown, estimator)
            discounts = estimator.gamma ** np.arange(len(flown.rewards))
            value = float(discounts @ flown.rewards.mean(axis=1))
            episodes, steps = estimator.episodes, int(flown.active.sum())
        vector = self._ascent.step(gradient.reshape(-1).astype(self._dtype))
        return Step(vector, value, episodes, steps, float(np.linalg.norm(gradient)))

    def route(self, theta: Vector) -> tuple[int, ...]:
        return tuple(self._model.most_followed_path(softmax(theta.reshape(self._shape))))
