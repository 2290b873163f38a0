from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.tabular.chain import chain_model
from sim.tabular.gridworld import LAYOUTS, Cell, grid_model
from sim.tabular.mdp import FiniteMDP, softmax
from sim.tabular.optimum import joint_optimum, optimal_policy, optimal_value

SIZE = (2, 3)
PAIRS = st.permutations([(0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]).map(lambda cells: cells[:2])


def tiny(tasks: Sequence[Sequence[Cell]], gamma: float = 0.9) -> list[FiniteMDP]:
    """2 x 3 grids; each task names its goal and its obstacle."""
    return [grid_model(SIZE, [goal], [obstacle], gamma=gamma) for goal, obstacle in tasks]


EVERY_POLICY = np.array(list(product(range(4), repeat=6)))  # (4096, S)


def best_by_enumeration(models: Sequence[FiniteMDP]) -> float:
    """The largest sum over all deterministic policies, each followed step by step."""
    totals = np.zeros(len(EVERY_POLICY))
    for model in models:
        states = np.zeros(len(EVERY_POLICY), dtype=np.intp)
        for t in range(7):
            actions = EVERY_POLICY[np.arange(len(EVERY_POLICY)), states]
            totals += model.gamma**t * model.rewards[states, actions, 0]
            states = model.successors[states, actions, 0]
    return float(totals.max())


def best_with_memory(models: Sequence[FiniteMDP], horizon: int) -> float:
    """The largest sum over all walks of so many steps."""

    def onward(states: tuple[int, ...], steps: int) -> float:
        if not steps or all(m.terminal[s] for m, s in zip(models, states, strict=True)):
            return 0.0
        options = []
        for action in range(4):
            moves = [
                (m.rewards[s, action, 0], int(m.successors[s, action, 0]))
                for m, s in zip(models, states, strict=True)
            ]
            after = onward(tuple(there for _, there in moves), steps - 1)
            options.append(sum(float(gain) for gain, _ in moves) + models[0].gamma * after)
        return max(options)

    return onward((0,) * len(models), horizon)


@settings(max_examples=8, deadline=None)
@given(tasks=st.lists(PAIRS, min_size=2, max_size=3))
def test_agrees_with_enumeration_on_tiny_grids(tasks: list[list[Cell]]) -> None:
    models = tiny(tasks)
    optimum, best = joint_optimum(models), best_by_enumeration(models)
    assert optimum.value == pytest.approx(best, abs=1e-12)
    assert optimum.bound >= best - 1e-12
    assert optimum.certified == (optimum.bound - best < 1e-9)


@settings(max_examples=6, deadline=None)
@given(first=PAIRS, second=PAIRS)
def test_bound_is_what_memory_could_reach(first: list[Cell], second: list[Cell]) -> None:
    models = tiny([first, second])
    reached = best_with_memory(models, 6)
    bound = joint_optimum(models).bound
    assert reached - 1e-12 <= bound <= reached + 2 * 0.9**6


@settings(max_examples=40, deadline=None)
@given(tasks=st.lists(PAIRS, min_size=1, max_size=4), seed=st.integers(0, 2**32 - 1))
def test_no_policy_passes_the_bound(tasks: list[list[Cell]], seed: int) -> None:
    models = tiny(tasks)
    policy = softmax(3 * np.random.default_rng(seed).normal(size=(6, 4)))
    assert sum(model.value(policy) for model in models) <= joint_optimum(models).bound + 1e-12


@pytest.mark.parametrize(("name", "solved"), [("a", 4), ("b", 4), ("c", 3), ("d", 6), ("e", 6)])
def test_layouts_have_a_certified_optimum(name: str, solved: int) -> None:
    plan, models = LAYOUTS[name], LAYOUTS[name].models()
    optimum = joint_optimum(models)
    assert optimum.certified
    assert optimum.value == pytest.approx(sum(m.value(optimum.policy) for m in models), abs=1e-12)
    goals = [row * 10 + column for row, column in plan.goals]
    reached = [
        model.reach_probability(optimum.policy, [goal])
        for model, goal in zip(models, goals, strict=True)
    ]
    assert sum(reached) == solved
    # Gamma to the step at which the path enters the goal, minus one.
    for value, goal, hit in zip(optimum.task_values, goals, reached, strict=True):
        if hit:
            assert value == pytest.approx(0.99 ** (optimum.path.index(goal) - 1), abs=1e-12)
    assert optimum.bound <= sum(optimal_value(model) for model in models)


def test_agents_may_share_a_task() -> None:
    four = LAYOUTS["a"].models()
    optimum = joint_optimum([model for model in four for _ in range(16)])
    assert optimum.certified
    assert optimum.value == pytest.approx(16 * joint_optimum(four).value, abs=1e-9)
    assert len(optimum.task_values) == 64
    # Of the two that cannot both have their way in (c), the majority has it.
    first, loser, winner, last = LAYOUTS["c"].models()
    outvoted = joint_optimum([first, loser, loser, winner, last])
    assert outvoted.certified
    assert outvoted.task_values[1] > 0 > outvoted.task_values[3]


def test_a_walk_that_must_turn_back_is_not_certified() -> None:
    models = [grid_model((1, 3), [goal], start=(0, 1), gamma=0.9) for goal in ((0, 0), (0, 2))]
    optimum = joint_optimum(models)
    assert optimum.bound == pytest.approx(1 + 0.9**2)
    assert optimum.value == pytest.approx(1)
    assert not optimum.certified


def test_a_hopeless_swarm_goes_round_for_ever() -> None:
    model = grid_model((1, 3), [(0, 2)], [(0, 1)])
    optimum = joint_optimum([model])
    assert (optimum.bound, optimum.value, optimum.certified) == (0, 0, True)
    assert optimum.path == (0, 0)


def test_forced_loss_is_counted() -> None:
    """One step from the only start to the obstacle, whatever one does."""
    trap = FiniteMDP(
        successors=np.array([[[1], [1]], [[1], [1]]]),
        probabilities=np.ones((2, 2, 1)),
        rewards=np.array([[[-1.0], [-1.0]], [[0.0], [0.0]]]),
        start=np.array([1.0, 0.0]),
        terminal=np.array([False, True]),
        gamma=0.9,
    )
    assert joint_optimum([trap, trap]).bound == -2


def test_policy_iteration_finds_the_shortest_way() -> None:
    model = grid_model((4, 5), [(3, 4)], [(0, 1)], gamma=0.9)
    assert optimal_value(model) == pytest.approx(0.9**6, abs=1e-12)
    policy = optimal_policy(model)
    assert model.advantages(policy).max() <= 1e-12
    for q in np.linspace(0, 1, 11):
        assert chain_model(1).value(np.tile((q, 1 - q), (5, 1))) <= optimal_value(chain_model(1))


def test_tasks_that_do_not_fit_together_are_refused() -> None:
    grid, other = grid_model((1, 3), [(0, 2)]), grid_model((3, 1), [(2, 0)])
    with pytest.raises(ValueError, match="models: task 1 moves otherwise"):
        joint_optimum([grid, other])
    with pytest.raises(ValueError, match=r"models: expected one shape \(S, A, 1\)"):
        joint_optimum([chain_model(1), chain_model(2)])
    with pytest.raises(ValueError, match=r"models: start in \[0, 1\]"):
        joint_optimum([grid, grid.with_start(np.eye(3)[1])])
    with pytest.raises(ValueError, match=r"models: start in \[0\], expected one certain state"):
        joint_optimum([grid.with_start(np.array([0.5, 0.5, 0]))])
    with pytest.raises(ValueError, match=r"models: gammas \[0\.9, 0\.99\]"):
        joint_optimum([grid, grid_model((1, 3), [(0, 2)], gamma=0.9)])
    with pytest.raises(ValueError, match="models: 20 different tasks, expected at most 16"):
        joint_optimum([grid_model((5, 5), [divmod(cell, 5)]) for cell in range(1, 21)])
    with pytest.raises(ValueError, match="models: start 2 is terminal"):
        joint_optimum([grid.with_start(np.eye(3)[2])])
