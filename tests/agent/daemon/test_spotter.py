"""What an agent shows of its flights: every audience gets the whole way since its last sample."""

from typing import Any

import gymnasium
import numpy as np

from agent.daemon.spotter import Spotter
from agent.learning.learner import Moment
from swarm.reports.telemetry import TRACK, FlightSample

WORLD: gymnasium.Env[Any, Any] = gymnasium.make("CartPole-v1")


class Watcher:
    """Wants every so many-th step."""

    def __init__(self, every: int) -> None:
        self._every, self._seen = every, 0
        self.samples: list[FlightSample] = []

    def flight_due(self) -> bool:
        self._seen += 1
        return self._seen % self._every == 0

    def flight(self, sample: FlightSample) -> None:
        self.samples.append(sample)


def moment(flight: int, step: int) -> Moment:
    pose = np.array([float(step), float(flight), -1.0, 0.0, 0.0, 0.5])
    picture = np.zeros((4, 6, 3), np.uint8)
    return Moment(WORLD, flight, step, 3, 1.5, picture, {"pose": pose, "distance": 0.4 * step})


def test_each_audience_has_its_own_rate_and_its_own_way() -> None:
    often, seldom = Watcher(2), Watcher(5)
    spotter = Spotter("drone0", lambda: 7, often, seldom)
    for step in range(10):
        spotter.see(moment(0, step))
    assert [len(sample.track) for sample in often.samples] == [2] * 5
    assert [len(sample.track) for sample in seldom.samples] == [5, 5]
    last = seldom.samples[-1]
    assert (last.agent, last.round, last.step, last.yaw) == ("drone0", 7, 9, 0.5)
    assert last.camera.startswith(b"\x89PNG")
    assert last.depth == b""


def test_a_new_flight_begins_a_new_way_and_a_long_one_keeps_its_ends() -> None:
    watcher = Watcher(3 * TRACK + 2)
    spotter = Spotter("drone0", lambda: 0, watcher)
    spotter.see(moment(0, 0))
    spotter.see(moment(0, 1))
    for step in range(3 * TRACK):
        spotter.see(moment(1, step))
    (sample,) = watcher.samples
    assert len(sample.track) <= TRACK
    assert sample.track[0] == (0.0, 1.0, -1.0)
    assert sample.track[-1] == sample.position == (3.0 * TRACK - 1, 1.0, -1.0)


def test_a_world_without_a_pose_is_not_shown() -> None:
    watcher = Watcher(1)
    Spotter("drone0", lambda: 0, watcher).see(
        Moment(WORLD, 0, 0, 0, 0.0, np.zeros(4, np.float32), {})
    )
    assert watcher.samples == []
