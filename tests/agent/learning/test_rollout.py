"""Flights of several worlds side by side: who flies when, and what is kept."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from agent.learning.rollout import Choice, Observations, Worlds


class Countdown(gymnasium.Env[Any, Any]):
    """Ends by itself after ``length`` steps; observes the step, pays 1, tells its length in m."""

    observation_space = spaces.Box(0, 1000, (1,), np.float32)
    action_space = spaces.Discrete(2)

    def __init__(self, length: int) -> None:
        self.length, self.t, self.begun = length, 0, 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        self.t = 0
        self.begun += 1
        return np.array([0.0], np.float32), {}

    def step(self, action: int) -> Any:
        self.t += 1
        info = {"distance": 0.4 * self.t}
        return np.array([self.t], np.float32), 1.0, self.t == self.length, False, info


def act(seen: Observations) -> Choice:
    """Always 1; the value is what is seen."""
    n = len(seen)
    return Choice(np.ones(n, np.int64), np.full(n, -0.5, np.float32), seen[:, 0])


SEEDS = np.arange(8)


def worlds(*lengths: int, horizon: int = 100) -> Worlds:
    return Worlds([Countdown(length) for length in lengths], gamma=0.5, horizon=horizon)


def test_whole_flights_are_dealt_evenly_however_long_they_are() -> None:
    stretches, ended = worlds(2, 7).episodes(act, 4, SEEDS)
    assert sorted(len(s.rewards) for s in stretches) == [2, 2, 7, 7]
    assert all(s.last is None and s.start == 0 for s in stretches)
    assert sorted(flight.steps for flight in ended) == [2, 2, 7, 7]
    assert ended[0].value == 1.5
    assert ended[0].distance == 0.8


def test_a_stretch_keeps_what_the_policy_said() -> None:
    (stretch,), _ = worlds(3).episodes(act, 1, SEEDS)
    assert [float(o[0]) for o in stretch.observations] == [0, 1, 2]
    assert stretch.values == [0, 1, 2]
    assert stretch.actions == [1, 1, 1]
    assert stretch.log_probs == [-0.5, -0.5, -0.5]


def test_the_horizon_cuts_and_keeps_what_came_next() -> None:
    (stretch,), (flight,) = worlds(9, horizon=4).episodes(act, 1, SEEDS)
    assert len(stretch.rewards) == 4
    assert stretch.last is not None
    assert stretch.last[0] == 4
    assert flight.steps == 4


def test_segments_go_on_where_they_stopped() -> None:
    group = worlds(5)
    first, ended = group.segment(act, 3, SEEDS)
    assert not ended
    assert first[0].last is not None
    assert first[0].last[0] == 3
    second, ended = group.segment(act, 3, SEEDS)
    assert [(s.start, len(s.rewards), s.last is None) for s in second] == [
        (3, 2, True),
        (0, 1, False),
    ]
    assert ended[0].steps == 5
    assert ended[0].value == sum(0.5**t for t in range(5))


def test_whole_flights_make_up_for_the_steps_asked_for() -> None:
    group = worlds(*[30] * 4)
    flown = 0
    for round_ in range(1, 21):
        stretches, _ = group.flights(act, 100, SEEDS)
        assert all(s.last is None for s in stretches)
        flown += sum(len(s.rewards) for s in stretches)
        assert abs(flown - 100 * round_) <= 60
    assert len(group.flights(act, 1, SEEDS)[0]) >= 1  # at least one in every round


def test_a_world_that_has_flown_its_share_stands_still() -> None:
    envs = [Countdown(2), Countdown(50)]
    Worlds(list(envs), 0.9, 100).episodes(act, 2, SEEDS)
    assert [env.begun for env in envs] == [1, 1]
    assert [env.t for env in envs] == [2, 50]
