from typing import Any

import gymnasium
import numpy as np
import pytest

import sim  # noqa: F401  registers the environments
from sim.tabular.gridworld import (
    DOWN,
    LAYOUTS,
    LEFT,
    RIGHT,
    UP,
    GridWorld,
    grid_model,
)


def test_layouts_are_those_of_the_notes() -> None:
    assert [LAYOUTS[name].n_tasks for name in "abcde"] == [4, 4, 4, 6, 6]
    assert LAYOUTS["d"].goals == LAYOUTS["e"].goals
    assert LAYOUTS["d"].obstacles == LAYOUTS["e"].obstacles
    assert (LAYOUTS["d"].start, LAYOUTS["e"].start) == ((0, 0), (0, 9))
    assert LAYOUTS["a"].goals[0] == (8, 2)
    assert LAYOUTS["e"].obstacles[5] == ((1, 9), (4, 1), (4, 6), (9, 8))
    # Conflicts, as the paper describes them: whose goal is whose obstacle?
    clashes = {
        name: {
            (owner, other)
            for owner, goal in enumerate(plan.goals)
            for other, cells in enumerate(plan.obstacles)
            if goal in cells
        }
        for name, plan in LAYOUTS.items()
    }
    assert clashes["a"] == set()
    assert (2, 1) in clashes["b"]
    assert {(1, 2), (2, 1)} <= clashes["c"]


def test_cells_move_and_walls_hold() -> None:
    model = grid_model((2, 3), [(1, 2)])
    #  0 1 2
    #  3 4 5
    assert model.successors[0, :, 0].tolist() == [0, 3, 0, 1]
    assert model.successors[4, [UP, DOWN, LEFT, RIGHT], 0].tolist() == [1, 4, 3, 5]
    assert model.successors[5, :, 0].tolist() == [5, 5, 5, 5]
    assert model.rewards[4, :, 0].tolist() == [0, 0, 0, 1]
    assert model.rewards[5].max() == 0


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_task_is_made_as_an_environment(name: str) -> None:
    plan = LAYOUTS[name]
    for task, exact in enumerate(plan.models()):
        env = gymnasium.make("sim:GridWorld-v0", layout=name, task=task).unwrapped
        assert isinstance(env, GridWorld)
        assert env.goal_states.tolist() == [plan.goals[task][0] * 10 + plan.goals[task][1]]
        assert len(env.obstacle_states) == len(plan.obstacles[task])
        assert env.reset(seed=1)[0] == plan.start[0] * 10 + plan.start[1]
        for field in ("successors", "probabilities", "rewards", "start", "terminal"):
            np.testing.assert_array_equal(getattr(env.model, field), getattr(exact, field))
        assert np.flatnonzero(env.model.terminal).size == 1 + len(plan.obstacles[task])


def test_environment_pays_and_ends_as_specified() -> None:
    env = GridWorld(size=(2, 2), goals=[(1, 1)], obstacles=[(0, 1)])
    env.reset(seed=0)
    assert [*env.step(np.int64(UP))] == [0, 0.0, False, False, {}]
    assert [*env.step(np.int64(RIGHT))] == [1, -1.0, True, False, {}]
    env.reset()
    env.step(np.int64(DOWN))
    assert [*env.step(np.int64(RIGHT))] == [3, 1.0, True, False, {}]


def test_horizon_truncates() -> None:
    env = GridWorld(horizon=2)
    env.reset(seed=0)
    assert env.step(np.int64(UP))[3] is False
    assert env.step(np.int64(UP))[3] is True
    env.reset()
    assert env.step(np.int64(UP))[3] is False


def test_starts_are_drawn_and_seeded() -> None:
    chances = [0.5, 0.25, 0.25, 0]
    env = GridWorld(size=(2, 2), goals=[(1, 1)], start_distribution=chances)
    first = [int(env.reset(seed=seed)[0]) for seed in range(50)]
    assert first == [int(env.reset(seed=seed)[0]) for seed in range(50)]
    assert set(first) == {0, 1, 2}


def test_most_followed_path() -> None:
    model = grid_model((2, 3), [(1, 2)])
    right_then_down = np.full((6, 4), 0.1)
    right_then_down[:, RIGHT] = 0.7
    right_then_down[2, [RIGHT, DOWN]] = 0.1, 0.7
    assert model.most_followed_path(right_then_down) == [0, 1, 2, 5]
    assert model.most_followed_path(np.eye(4)[[UP] * 6]) == [0, 0]
    back = np.eye(4)[[RIGHT, LEFT, 0, 0, 0, 0]]
    assert model.most_followed_path(back) == [0, 1, 0]
    assert model.with_start(np.eye(6)[5]).most_followed_path(back) == [5]


def test_renders_text_and_pictures() -> None:
    world: dict[str, Any] = {"size": (2, 3), "goals": [(1, 2)], "obstacles": [(0, 2)]}
    text = GridWorld(**world, render_mode="ansi")
    text.reset(seed=0)
    assert text.render() == "o.#\n..G\n"
    picture = GridWorld(**world, render_mode="rgb_array")
    picture.reset(seed=0)
    frame = picture.render()
    assert frame.shape == (32, 48, 3)
    assert len(np.unique(frame.reshape(-1, 3), axis=0)) == 4
    assert GridWorld(**world).render() is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"layout": "z"}, "layout: 'z', expected one of a, b, c, d, e"),
        ({"layout": "a"}, "task: None, expected 0 to 3 in 'a'"),
        ({"layout": "a", "task": 4}, "task: 4, expected 0 to 3 in 'a'"),
        ({"task": 1}, "task: 1, expected None without a layout"),
        ({"size": (0, 3)}, r"size: \(0, 3\), expected at least one row"),
        ({"goals": [(10, 0)]}, r"goals: cell \(10, 0\), expected one of a 10 x 10 grid"),
        ({"obstacles": [(9, 9)]}, r"obstacles: \(9, 9\) is a goal too"),
        ({"start": (9, 9)}, r"start: \(9, 9\) is a goal or an obstacle"),
        ({"start": (0, -1)}, r"start: cell \(0, -1\)"),
        ({"start": (0, 0), "start_distribution": [1.0]}, "start_distribution: start is given too"),
        ({"start_distribution": [1.0]}, r"start: shape \(1,\), expected \(100,\)"),
        ({"horizon": 0}, "horizon: 0, expected a positive number"),
        ({"render_mode": "human"}, "render_mode: 'human', expected None or one of"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        GridWorld(**arguments)
