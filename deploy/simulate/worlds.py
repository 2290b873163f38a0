"""Many finite worlds of one shape at once: what a `FiniteMDP` says of one, batched.

Bit for bit what the worlds say alone: the same sums in the same order, the same linear solves.
"""

from collections.abc import Sequence

import numpy as np

from sim.tabular.mdp import FiniteMDP, Floats

CHUNK = 128  # worlds solved at a time: bounds the memory for their (S, S) matrices


class Worlds:
    """M models of one shape (S, A, B); the same object may stand for many of them."""

    def __init__(self, models: Sequence[FiniteMDP]) -> None:
        shapes = {model.successors.shape for model in models}
        if len(shapes) != 1:
            raise ValueError(f"models: shapes {sorted(shapes)}, expected one (S, A, B) for all")
        self._successors = np.stack([model.successors for model in models])
        self._probabilities = np.stack([model.probabilities for model in models])
        rewards = np.stack([model.rewards for model in models])
        self._mean_rewards = (self._probabilities * rewards).sum(axis=3)
        self._start = np.stack([model.start for model in models])
        self._gamma = np.array([model.gamma for model in models])

    def values(self, policies: Floats) -> Floats:
        """(M,) V(rho), Eq. 1, of each world under its own policy (M, S, A)."""
        found = [self._solve(policies[at], at)[1] for at in self._chunks()]
        return np.asarray((self._start * np.concatenate(found)).sum(axis=1))

    def gradients(self, policies: Floats, entropy_weight: float) -> tuple[Floats, Floats]:
        """(M,) V(rho) and (M, S, A) gradients of the regularised objective, Eq. 9."""
        found = [self._gradients(policies[at], at) for at in self._chunks()]
        values, gradients = (np.concatenate(part) for part in zip(*found, strict=True))
        _, n_states, n_actions = policies.shape
        pull = entropy_weight / n_states * (1 / n_actions - policies)
        return (self._start * values).sum(axis=1), gradients + pull

    def _chunks(self) -> list[slice]:
        return [slice(i, i + CHUNK) for i in range(0, len(self._gamma), CHUNK)]

    def _gradients(self, policies: Floats, at: slice) -> tuple[Floats, Floats]:
        """State values and the gradients of V(rho)."""
        bellman, values = self._solve(policies, at)
        gamma = self._gamma[at, None]
        starts = ((1 - gamma) * self._start[at])[:, :, None]
        visits = np.linalg.solve(bellman.transpose(0, 2, 1), starts)[:, :, 0]
        world = np.arange(len(policies))[:, None, None, None]
        follow = (self._probabilities[at] * values[world, self._successors[at]]).sum(axis=3)
        ahead = self._mean_rewards[at] + gamma[:, :, None] * follow
        advantages = ahead - values[:, :, None]
        return values, (visits / (1 - gamma))[:, :, None] * policies * advantages

    def _solve(self, policies: Floats, at: slice) -> tuple[Floats, Floats]:
        """I - gamma P_pi (n, S, S), and V (n, S)."""
        n, n_states, _ = policies.shape
        rows = np.arange(n * n_states).reshape(n, n_states, 1, 1) * n_states
        weights = policies[:, :, :, None] * self._probabilities[at]
        cells = (rows + self._successors[at]).ravel()
        transitions = np.bincount(cells, weights.ravel(), n * n_states**2)
        transitions = transitions.reshape(n, n_states, n_states)
        bellman = np.eye(n_states) - self._gamma[at, None, None] * transitions
        rewards = (policies * self._mean_rewards[at]).sum(axis=2)
        return bellman, np.linalg.solve(bellman, rewards[:, :, None])[:, :, 0]
