"""Finite Markov decision processes with everything exact: V, Q, A, d, the objective, its gradient.

A `FiniteMDP` lists, for every state and action, at most B successors.  Policies are (S, A) arrays
of probabilities, rows sum to one; zeros are allowed.  Discounted quantities are one linear solve
each; nothing here samples, except `FiniteMDP.sample`, which hands over to `sim.tabular.episodes`.

Source: the paper, Eqs. 1, 2, 4, 6, 7 and 9, with corrections 1, 3 and 4 of the notes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.tabular.episodes import Episodes, Sampler, check_distribution

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]


def softmax(logits: Floats) -> Floats:
    """The policy of Eq. 4, over the last axis: exp(theta_sa) / sum_a' exp(theta_sa')."""
    weights = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def relative_entropy(policy: Floats) -> float:
    """RE of Eq. 6, KL(uniform, pi) averaged over states, with the sum over s that the print drops.

    `-1/(|S||A|) sum_{s,a} log pi(a|s) - log|A|`; zero for the uniform policy, inf if any pi is 0.
    """
    with np.errstate(divide="ignore"):
        return float(-np.log(policy).mean() - np.log(policy.shape[1]))


@dataclass(frozen=True, eq=False)
class FiniteMDP:
    """A world with S states, A actions and at most B successors of each state and action.

    The arrays are copied, checked and made read-only.
    """

    successors: Ints  # (S, A, B) the states that may follow
    probabilities: Floats  # (S, A, B) of each of them; an unused slot has probability 0
    rewards: Floats  # (S, A, B) of that transition
    start: Floats  # (S,) distribution of the first state (rho)
    terminal: Bools  # (S,) absorbing without reward: the episode ends on arrival
    gamma: float  # discount, in [0, 1)

    def __post_init__(self) -> None:
        for name, dtype in (
            ("successors", np.intp),
            ("probabilities", np.float64),
            ("rewards", np.float64),
            ("start", np.float64),
            ("terminal", np.bool_),
        ):
            array = np.array(getattr(self, name), dtype=dtype)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        self._validate()

    def _validate(self) -> None:
        shape = self.successors.shape
        if len(shape) != 3 or 0 in shape:
            raise ValueError(f"successors: shape {shape}, expected (S, A, B), none of them 0")
        for name, expected in (
            ("probabilities", shape),
            ("rewards", shape),
            ("start", shape[:1]),
            ("terminal", shape[:1]),
        ):
            found = getattr(self, name).shape
            if found != expected:
                raise ValueError(f"{name}: shape {found}, expected {expected}")
        if not 0 <= self.gamma < 1:
            raise ValueError(f"gamma: {self.gamma}, expected a number in [0, 1)")
        if self.successors.min() < 0 or self.successors.max() >= shape[0]:
            raise ValueError(f"successors: a state outside 0..{shape[0] - 1}")
        if not np.isfinite(self.rewards).all():
            raise ValueError("rewards: a value that is not finite")
        check_distribution("probabilities", self.probabilities)
        check_distribution("start", self.start)
        ended = np.flatnonzero(self.terminal)
        leaves = self.successors[ended] != ended[:, None, None]
        moves = self.probabilities[ended] > 0
        if (leaves & moves).any() or self.rewards[ended].any():
            raise ValueError("terminal: every terminal state must stay where it is, without reward")

    @property
    def n_states(self) -> int:
        return len(self.successors)

    @property
    def n_actions(self) -> int:
        return int(self.successors.shape[1])

    def with_start(self, start: ArrayLike) -> FiniteMDP:
        """The same world with another start distribution, (S,)."""
        return replace(self, start=np.asarray(start, dtype=np.float64))

    # -- what a policy is worth ------------------------------------------------------------------

    def values(self, policy: Floats) -> Floats:
        """V (S,), Eq. 1: the solution of V = r_pi + gamma P_pi V."""
        rewards = (self._check(policy) * self._mean_rewards).sum(axis=1)
        return np.asarray(np.linalg.solve(self._bellman(policy), rewards))

    def action_values(self, policy: Floats) -> Floats:
        """Q (S, A), Eq. 2: r(s, a) + gamma E[V(s')]."""
        return self._look_ahead(self.values(policy))

    def advantages(self, policy: Floats) -> Floats:
        """A (S, A), Eq. 2: Q(s, a) - V(s)."""
        values = self.values(policy)
        return self._look_ahead(values) - values[:, None]

    def visitation(self, policy: Floats) -> Floats:
        """d (S,): the discounted share of time in each state, rho^T (1-gamma) (I - gamma P)^-1.

        Absorbing states count for ever, so that d sums to one.
        """
        return np.asarray(np.linalg.solve(self._bellman(policy).T, (1 - self.gamma) * self.start))

    def value(self, policy: Floats) -> float:
        """V(rho): the expected discounted return from the start distribution."""
        return float(self.start @ self.values(policy))

    def objective(self, policy: Floats, entropy_weight: float) -> float:
        """L of Eq. 7: V(rho) - entropy_weight * RE(pi)."""
        penalty = entropy_weight * relative_entropy(policy) if entropy_weight else 0.0
        return self.value(policy) - penalty

    def gradient(self, policy: Floats, entropy_weight: float) -> Floats:
        """dL/dtheta (S, A), Eq. 9, at the softmax policy: the gradient of `objective`."""
        occupancy = self.visitation(policy)[:, None] / (1 - self.gamma)
        pull = entropy_weight / self.n_states * (1 / self.n_actions - policy)
        return occupancy * policy * self.advantages(policy) + pull

    def reach_probability(self, policy: Floats, targets: Sequence[int] | Ints) -> float:
        """Probability, undiscounted, that a path from the start distribution ever enters `targets`.

        Right for policies that may wander for ever, and to relative machine precision also where
        leaving a loop is all but impossible: states from which the targets are out of reach are
        cut off (which picks the minimal non-negative solution), the others are eliminated one by
        one without a subtraction (Grassmann, Taksar, Heyman 1985).
        """
        transitions = self.transitions(policy)
        hit = np.zeros(self.n_states, dtype=np.bool_)
        hit[np.asarray(targets, dtype=np.intp)] = True
        can_reach, frontier = hit.copy(), hit
        while frontier.any():
            frontier = (transitions[:, frontier] > 0).any(axis=1) & ~can_reach
            can_reach |= frontier
        between = can_reach & ~hit
        # Row 0 is the start, the others are the states between it and the targets;
        # columns: into the targets, out of reach, (never back to) the start, the states between.
        source = np.vstack([self.start, transitions[between]])
        flow = np.column_stack(
            [
                source[:, hit].sum(axis=1),
                source[:, ~can_reach].sum(axis=1),
                np.zeros(len(source)),
                source[:, between],
            ]
        )
        for state in range(len(flow) - 1, 0, -1):
            onward = flow[state, : state + 2] / flow[state, : state + 2].sum()
            flow[:state, : state + 2] += np.outer(flow[:state, state + 2], onward)
        return float(flow[0, 0] / (flow[0, 0] + flow[0, 1]))

    # -- how a policy moves ----------------------------------------------------------------------

    def transitions(self, policy: Floats) -> Floats:
        """P_pi (S, S): row s is the distribution of the state that follows s."""
        weights = self._check(policy)[:, :, None] * self.probabilities
        flat = np.bincount(self._pairs, weights.ravel(), self.n_states**2)
        return flat.astype(np.float64, copy=False).reshape(self.n_states, self.n_states)

    def most_followed_path(self, policy: Floats) -> list[int]:
        """The likeliest walk, as Fig. 2 draws: likeliest start, then always the likeliest action.

        Ends at a terminal state, or where a state comes up again (it is the last entry then).
        """
        path = [int(self.start.argmax())]
        while not self.terminal[path[-1]] and path[-1] not in path[:-1]:
            move = path[-1], int(policy[path[-1]].argmax())
            path.append(int(self.successors[move][self.probabilities[move].argmax()]))
        return path

    def sample(self, policy: Floats, uniforms: Floats) -> Episodes:
        """Episodes under `policy`, a pure function of `uniforms` (H+1, E, 2); see `Episodes`."""
        return self.sampler(policy[None], uniforms[None]).of_model(0)

    @cached_property
    def sampler(self) -> Sampler:
        """The tables from which `sample` draws, built once."""
        return Sampler([self])

    @cached_property
    def _pairs(self) -> Ints:
        """(S*A*B,) position of each transition in a flat (S, S) matrix."""
        return (np.arange(self.n_states)[:, None, None] * self.n_states + self.successors).ravel()

    @cached_property
    def _mean_rewards(self) -> Floats:
        """(S, A) expected reward of an action."""
        return np.asarray((self.probabilities * self.rewards).sum(axis=2))

    def _look_ahead(self, values: Floats) -> Floats:
        follow = (self.probabilities * values[self.successors]).sum(axis=2)
        return np.asarray(self._mean_rewards + self.gamma * follow)

    def _bellman(self, policy: Floats) -> Floats:
        return np.asarray(np.eye(self.n_states) - self.gamma * self.transitions(policy))

    def _check(self, policy: Floats) -> Floats:
        expected = (self.n_states, self.n_actions)
        if policy.shape != expected:
            raise ValueError(f"policy: shape {policy.shape}, expected {expected}")
        check_distribution("policy", policy)
        return policy
