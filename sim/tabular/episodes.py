"""Many episodes of finite worlds at once, as a pure function of uniform random numbers.

`sample_episodes` flies one world, `sample_swarm_episodes` N worlds of the same shape, each under
its own policy; per world the two agree bit for bit.  `Sampler` holds the tables that do not change
between calls.  The work per time step is a handful of NumPy calls whatever N and E; episodes that
are over leave the working arrays, and the loop ends with the last of them.

A step is one integer, the index of its transition in the flat (N, S, A, B) tables.  Only this
integer is recorded; states, actions and rewards are looked up once, at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sim.tabular.mdp import FiniteMDP

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]

TOLERANCE = 1e-6  # how far probabilities may be from summing to one; float32 passes


class Episodes(NamedTuple):
    """E episodes, padded to the longest of them, T <= H steps.  A swarm's have (T, N, E) arrays.

    Where `active` is False the other entries are 0.  An episode that starts in a terminal state
    has no step at all.
    """

    states: Ints  # (T, E) in which the step was taken
    actions: Ints  # (T, E)
    rewards: Floats  # (T, E)
    active: Bools  # (T, E) whether the step was really taken
    terminated: Bools  # (E,) whether a terminal state was reached; else the horizon cut it off
    last_states: Ints  # (E,) the state after the last step, to bootstrap from where it was cut

    def of_model(self, n: int) -> Episodes:
        """The n-th model's episodes out of a swarm's."""
        return Episodes(
            states=self.states[:, n],
            actions=self.actions[:, n],
            rewards=self.rewards[:, n],
            active=self.active[:, n],
            terminated=self.terminated[n],
            last_states=self.last_states[n],
        )


def sample_episodes(model: FiniteMDP, policy: Floats, uniforms: Floats) -> Episodes:
    """E episodes of at most H steps under `policy` (S, A), drawn with `uniforms` (H+1, E, 2).

    Numbers in [0, 1).  Row 0, column 0 draws the start states; row t+1 the step t: column 0 its
    action, column 1 its successor, all by inverse distribution function.
    """
    return model.sample(policy, uniforms)


def sample_swarm_episodes(
    models: Sequence[FiniteMDP], policies: Floats, uniforms: Floats
) -> Episodes:
    """As `sample_episodes` for N models: policies (N, S, A), uniforms (N, H+1, E, 2).

    Whoever calls this often keeps a `Sampler` instead.
    """
    return Sampler(models)(policies, uniforms)


class Sampler:
    """N worlds of one shape, stacked and ready to be flown together."""

    def __init__(self, models: Sequence[FiniteMDP]) -> None:
        shapes = {model.successors.shape for model in models}
        if len(shapes) != 1:
            raise ValueError(f"models: shapes {sorted(shapes)}, expected one (S, A, B) for all")
        self.n_models = len(models)
        ((self.n_states, self.n_actions, self.n_branches),) = shapes
        size = self.n_models * self.n_states * self.n_actions
        # States are numbered through: state s of model n is row n * S + s.
        self._first_row = np.arange(self.n_models) * self.n_states
        successors = np.stack([model.successors for model in models])
        self._successors = (successors + self._first_row[:, None, None, None]).ravel()
        self._branches = _thresholds(
            np.stack([model.probabilities for model in models]).reshape(size, -1)
        )
        self._terminal = np.concatenate([model.terminal for model in models])
        self._starts, self._start_thresholds = _start_tables([model.start for model in models])
        # One more entry, at index -1: the step that was not taken.
        self._rewards = np.append(np.stack([model.rewards for model in models]), 0.0)
        steps = np.arange(size * self.n_branches) // self.n_branches
        self._state_of = np.append(steps // self.n_actions % self.n_states, 0)
        self._action_of = np.append(steps % self.n_actions, 0)

    def __call__(self, policies: Floats, uniforms: Floats) -> Episodes:
        """Episodes with (T, N, E) arrays; policies (N, S, A), uniforms (N, H+1, E, 2)."""
        thresholds = self._policy_thresholds(policies)
        horizon, n_episodes = self._check(uniforms)
        stream = np.ascontiguousarray(uniforms).reshape(-1)

        model, episode = np.divmod(np.arange(self.n_models * n_episodes), n_episodes)
        cursor = 2 * (model * (horizon + 1) * n_episodes + episode)  # where its numbers stand
        row = self._first_rows(model, stream.take(cursor))
        over = self._terminal.take(row)

        taken = np.full((horizon, row.size), -1, dtype=np.intp)
        terminated = np.zeros(row.size, dtype=np.bool_)
        last_row = np.empty(row.size, dtype=np.intp)
        who = np.arange(row.size)  # the episodes that go on
        length = 0
        while True:
            if np.count_nonzero(over):
                last_row[who[over]] = row[over]
                terminated[who[over]] = True
                go_on = ~over
                who, row, cursor = who[go_on], row[go_on], cursor[go_on]
            if length == horizon or not who.size:
                break
            cursor += 2 * n_episodes
            step = row * self.n_actions
            step += _invert(thresholds.take(row, axis=0), stream.take(cursor))
            if self.n_branches > 1:
                branch = _invert(self._branches.take(step, axis=0), stream.take(cursor + 1))
                step *= self.n_branches
                step += branch
            taken[length, who] = step
            row = self._successors.take(step)
            over = self._terminal.take(row)
            length += 1
        last_row[who] = row

        steps = taken[:length].reshape(length, self.n_models, n_episodes)
        return Episodes(
            states=self._state_of.take(steps),
            actions=self._action_of.take(steps),
            rewards=self._rewards.take(steps),
            active=steps >= 0,
            terminated=terminated.reshape(self.n_models, n_episodes),
            last_states=(last_row % self.n_states).reshape(self.n_models, n_episodes),
        )

    def _first_rows(self, model: Ints, uniforms: Floats) -> Ints:
        slot = _invert(self._start_thresholds.take(model, axis=0), uniforms)
        return np.asarray(self._starts[model, slot] + self._first_row.take(model))

    def _policy_thresholds(self, policies: Floats) -> Floats:
        expected = (self.n_models, self.n_states, self.n_actions)
        if policies.shape != expected:
            raise ValueError(f"policies: shape {policies.shape}, expected {expected}")
        check_distribution("policies", policies)
        return _thresholds(policies.reshape(-1, self.n_actions))

    def _check(self, uniforms: Floats) -> tuple[int, int]:
        shape = uniforms.shape
        if len(shape) != 4 or shape[0] != self.n_models or shape[1] < 1 or shape[3] != 2:
            raise ValueError(f"uniforms: shape {shape}, expected ({self.n_models}, H+1, E, 2)")
        return shape[1] - 1, shape[2]


def check_distribution(name: str, probabilities: NDArray[np.floating]) -> None:
    """Raise unless the last axis holds distributions; NaN does not pass."""
    excess = np.abs(probabilities.sum(axis=-1) - 1)
    if not (probabilities.min() >= 0 and excess.max() <= TOLERANCE):
        raise ValueError(
            f"{name}: smallest {probabilities.min():g}, largest distance of a sum from 1 "
            f"{excess.max():g}, expected distributions"
        )


def _thresholds(probabilities: Floats) -> Floats:
    """(R, K) distributions -> (R, K-1) inner points of their distribution functions.

    Divided by the last point, so that an outcome of probability zero is never drawn.
    """
    points = np.cumsum(probabilities, axis=1, dtype=np.float64)
    return np.ascontiguousarray(points[:, :-1] / points[:, -1:])


def _invert(thresholds: Floats, uniforms: Floats) -> Ints:
    """The outcome that each number picks: how many of its row's thresholds it has passed."""
    passed = uniforms[:, None] >= thresholds
    return np.asarray(np.add.reduce(passed, axis=1, dtype=np.intp))


def _start_tables(starts: Sequence[Floats]) -> tuple[Ints, Floats]:
    """(N, K) the possible start states of each model, and the (N, K-1) thresholds between them."""
    support = [np.flatnonzero(start) for start in starts]
    width = max(states.size for states in support)
    states = np.zeros((len(starts), width), dtype=np.intp)
    probabilities = np.zeros((len(starts), width))
    for n, (start, possible) in enumerate(zip(starts, support, strict=True)):
        states[n, : possible.size] = possible
        probabilities[n, : possible.size] = start[possible]
    return states, _thresholds(probabilities)
