"""What can be reached at all: the best policy for one task, and the best single one for many.

`optimal_policy` is policy iteration on one world.  `joint_optimum` maximises the sum of Eq. 5 over
tasks that share a deterministic way to move and one start, and pay only where an episode ends:

1.  A dynamic program over (state, set of unfinished tasks) bounds the sum from above for every
    policy, whatever it remembers.  All unfinished tasks stand in the same state, so that the swarm
    is one walk, which earns gamma^t r where it ends a task; chance cannot help such a walk.  Sets
    only shrink, so each asks for smaller ones; a task that is never finished adds nothing.
2.  A beam search, led by this bound, looks for a walk that never takes two actions in one state,
    that is, for a policy without memory.  If its exactly evaluated sum is the bound, the optimum is
    certified.  If not, the optimum lies between the two numbers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain
from typing import NamedTuple

import numpy as np

from sim.tabular.mdp import FiniteMDP, Floats, Ints

TOLERANCE = 1e-9  # between bound and value of a certified optimum
NEGLIGIBLE = 1e-12  # differences of sums below are rounding
ROUNDING = 1e-14  # of advantages, in units of the largest possible return
WIDTH = 300  # walks of one length that the search keeps; a guess, 1000 found nothing better
MOST_TASKS = 16  # different ones: the program looks at every subset


def optimal_policy(model: FiniteMDP) -> Floats:
    """A deterministic policy (S, A) that is best from every state, by policy iteration."""
    actions = np.zeros(model.n_states, dtype=np.intp)
    rounding = ROUNDING * np.abs(model.rewards).max() / (1 - model.gamma)
    while True:
        policy = np.eye(model.n_actions)[actions]
        advantages = model.advantages(policy)
        better = advantages.max(axis=1) > rounding
        if not better.any():
            return policy
        actions = np.where(better, advantages.argmax(axis=1), actions)


def optimal_value(model: FiniteMDP) -> float:
    """V*(rho) of one world: what an agent alone could reach."""
    return model.value(optimal_policy(model))


@dataclass(frozen=True, eq=False)
class JointOptimum:
    """The best that one policy does in all tasks together."""

    bound: float  # no policy has a larger sum of values, not even one with memory
    value: float  # the sum that `policy` has, exactly evaluated
    task_values: tuple[float, ...]  # of which each task contributes so much
    path: tuple[int, ...]  # the states of its walk until all tasks end or a state comes up again
    policy: Floats  # (S, A) deterministic

    @property
    def certified(self) -> bool:
        """Whether `policy` is optimal beyond doubt; else it is the best one found."""
        return abs(self.bound - self.value) <= TOLERANCE


def joint_optimum(models: Sequence[FiniteMDP]) -> JointOptimum:
    """The optimum of the sum over `models`, one for each agent; see the module's docstring.

    Agents may share a task: 64 agents with four tasks are no more work than four.
    """
    program = _Program(models)
    walk = program.best_walk()
    choices = program.look_ahead(program.everyone).argmax(axis=1)  # off the walk: the hopeful one
    choices[list(walk.path[:-1])] = walk.actions
    policy = np.eye(models[0].n_actions)[choices]
    task_values = tuple(model.value(policy) for model in models)
    return JointOptimum(
        bound=float(program.values(program.everyone)[program.start]),
        value=sum(task_values),
        task_values=task_values,
        path=walk.path,
        policy=policy,
    )


class _Walk(NamedTuple):
    """What the tasks do together, up to some step."""

    promise: float  # the most that it can come to
    earned: float  # so far
    unfinished: int  # tasks
    path: tuple[int, ...]  # states
    actions: tuple[int, ...]  # one fewer

    @property
    def complete(self) -> bool:
        """No task is left; or it meets itself, goes round for ever and earns nothing more."""
        return not self.unfinished or self.path[-1] in self.path[:-1]


def _promise(walk: _Walk) -> float:
    return walk.promise


class _Program:
    """The walk of all tasks; a set of unfinished tasks is an integer, one bit for each task."""

    def __init__(self, models: Sequence[FiniteMDP]) -> None:
        self.gamma, self.start = _common_gamma(models), _common_start(models)
        self.successors = _common_moves(models)  # (S, A)
        names = [(model.rewards.tobytes(), model.terminal.tobytes()) for model in models]
        agents, tasks = Counter(names), dict(zip(names, models, strict=True))
        if len(tasks) > MOST_TASKS:
            raise ValueError(f"models: {len(tasks)} different tasks, expected at most {MOST_TASKS}")
        # (N, S, A) what all agents of a task earn together
        self.rewards = np.stack([agents[name] * tasks[name].rewards[:, :, 0] for name in tasks])
        bits = 1 << np.arange(len(tasks))
        terminal = np.stack([task.terminal for task in tasks.values()])
        self.ends: Ints = bits @ terminal  # (S,) the tasks that end in each state
        self.everyone = int(bits.sum())
        pays_on_the_way = (self.rewards != 0) & ~terminal[:, self.successors]
        if pays_on_the_way.any():
            raise ValueError("models: a reward before the end, expected rewards only on ending")
        if self.ends[self.start]:
            raise ValueError(f"models: start {self.start} is terminal, expected one that is not")
        self.values, self.look_ahead = cache(self._values), cache(self._look_ahead)

    def left(self, unfinished: int) -> Ints:
        """(S,) the tasks that are still unfinished on arrival in each state."""
        return np.asarray(unfinished & ~self.ends)

    def gains(self, unfinished: int) -> Floats:
        """(S, A) what the unfinished tasks earn at once."""
        members = [n for n in range(len(self.rewards)) if unfinished >> n & 1]
        return np.asarray(self.rewards[members].sum(axis=0))

    def _values(self, unfinished: int) -> Floats:
        """(S,) the most that the unfinished tasks can still earn from each state."""
        return np.asarray(self.look_ahead(unfinished).max(axis=1))

    def _look_ahead(self, unfinished: int) -> Floats:
        """(S, A) the same, by first action: value iteration, exact after at most S sweeps."""
        left, gains = self.left(unfinished), self.gains(unfinished)
        arrival = np.zeros(left.size)  # (S,) the value on arrival
        for state in np.flatnonzero((left != unfinished) & (left != 0)):
            arrival[state] = self.values(int(left[state]))[state]
        inside = left == unfinished
        while True:
            ahead = gains + self.gamma * arrival[self.successors]
            values = ahead.max(axis=1)
            if np.array_equal(values[inside], arrival[inside]):
                return np.asarray(ahead)
            arrival[inside] = values[inside]

    def best_walk(self) -> _Walk:
        """The best walk that leaves each state always by the same action, as far as was searched.

        Of walks that stand in one state, with the same tasks left and the same states behind them,
        only the best is kept; then the `WIDTH` most promising of each length.
        """
        bound = float(self.values(self.everyone)[self.start])
        best = _Walk(-np.inf, 0.0, self.everyone, (self.start,), ())
        walks = [best._replace(promise=bound)]
        while walks and best.promise < bound - NEGLIGIBLE:
            longer: dict[tuple[int, int, frozenset[int]], _Walk] = {}
            for walk in chain.from_iterable(map(self.continuations, walks)):
                if walk.complete:
                    best = max(best, walk, key=_promise)
                elif walk.promise > best.promise + NEGLIGIBLE:
                    alike = walk.path[-1], walk.unfinished, frozenset(walk.path)
                    longer[alike] = max(longer.get(alike, walk), walk, key=_promise)
            walks = sorted(longer.values(), key=_promise, reverse=True)[:WIDTH]
        return best

    def continuations(self, walk: _Walk) -> Iterator[_Walk]:
        """The walk, one step longer, by each action."""
        here, discount = walk.path[-1], self.gamma ** len(walk.actions)
        gains, left = self.gains(walk.unfinished)[here], self.left(walk.unfinished)
        for action, there in enumerate(self.successors[here].tolist()):
            earned, unfinished = walk.earned + discount * float(gains[action]), int(left[there])
            longer = _Walk(earned, earned, unfinished, (*walk.path, there), (*walk.actions, action))
            if not longer.complete:
                hope = discount * self.gamma * float(self.values(unfinished)[there])
                longer = longer._replace(promise=earned + hope)
            yield longer


def _common_gamma(models: Sequence[FiniteMDP]) -> float:
    gammas = {model.gamma for model in models}
    if len(gammas) != 1:
        raise ValueError(f"models: gammas {sorted(gammas)}, expected one for all")
    return gammas.pop()


def _common_start(models: Sequence[FiniteMDP]) -> int:
    starts = {int(model.start.argmax()) for model in models}
    if len(starts) != 1 or any(model.start.max() < 1 for model in models):
        raise ValueError(f"models: start in {sorted(starts)}, expected one certain state for all")
    return starts.pop()


def _common_moves(models: Sequence[FiniteMDP]) -> Ints:
    """(S, A) where every action leads, in whatever task the state is not terminal."""
    if any(model.successors.shape != (*models[0].successors.shape[:2], 1) for model in models):
        raise ValueError("models: expected one shape (S, A, 1), that is, deterministic moves")
    moves = models[0].successors[:, :, 0].copy()
    for model in reversed(models):
        moves[~model.terminal] = model.successors[~model.terminal, :, 0]
    for n, model in enumerate(models):
        if (model.successors[:, :, 0] != moves)[~model.terminal].any():
            raise ValueError(f"models: task {n} moves otherwise, expected common moves")
    return moves
