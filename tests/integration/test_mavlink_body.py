"""``IndoorFlight-v0`` through the full vehicle: ``body="mavlink"``, lockstep over real UDP."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

pytestmark = pytest.mark.integration
ROOT = Path(__file__).parents[2]
STRAIGHT = 12


def make(**kwargs: Any) -> Any:
    return gymnasium.make(
        "sim:IndoorFlight-v0", scene="indoor-long", body="mavlink", disable_env_checker=True,
        **kwargs,
    ).unwrapped  # fmt: skip


def make_vec(count: int, **kwargs: Any) -> Any:
    return gymnasium.make_vec(
        "sim:IndoorFlight-v0", num_envs=count, scene="indoor-long", body="mavlink",
        vectorization_mode="vector_entry_point", **kwargs,
    )  # fmt: skip


def gone(pid: int) -> bool:
    """Whether a process has ended (a zombie has)."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except OSError:
        return True
    return stat.rpartition(")")[2].split()[0] == "Z"


def until(condition: Callable[[], bool], what: str) -> None:
    end, pause = time.monotonic() + 30.0, threading.Event()
    while not condition():
        assert time.monotonic() < end, what
        pause.wait(0.05)


@pytest.fixture
def envs() -> Iterator[Any]:
    vector = make_vec(2, body_options={"flavour": "ardupilot"})
    yield vector
    vector.close()


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_flight_has_inertia_and_tilt_and_is_what_telemetry_says(flavour: str) -> None:
    env = make(body_options={"flavour": flavour})
    try:
        _, info = env.reset(seed=0, options={"start": 0})
        assert info["pose"] == pytest.approx((4.0, 2.3, -1.5, 0.0, 0.0, 0.0), abs=0.01)
        moved, tilts = [], []
        for _ in range(12):
            _, reward, crashed, _, info = env.step(STRAIGHT)
            assert not crashed and reward > 0
            moved.append(info["distance"])
            tilts.append(info["pose"][4])
        steps = np.diff(moved, prepend=0.0)
        assert steps[0] < 0.2  # from rest
        assert steps[-4:] == pytest.approx(np.full(4, 0.4), abs=0.03)
        assert min(tilts) < -0.1 and abs(tilts[-1]) < 0.06  # nose down to speed up
        _, info = env.reset(options={"pose": (4.0, 3.0, -1.2, 1.0)})
        assert info["pose"] == pytest.approx((4.0, 3.0, -1.2, 0.0, 0.0, 1.0), abs=0.01)
    finally:
        env.close()


def test_a_vector_flies_the_same_flights_as_single_environments(envs: Any) -> None:
    actions = np.random.default_rng(5).integers(25, size=(10, 2))
    envs.reset(seed=3)
    flown = [envs.step(action) for action in actions]
    single = make(body_options={"flavour": "ardupilot"})
    try:
        single.reset(seed=4)
        for action, (observations, rewards, crashed, _, infos) in zip(actions, flown, strict=True):
            observation, reward, ended, _, info = single.step(action[1])
            assert (reward, ended) == (rewards[1], crashed[1])
            if ended:
                break  # the vector has begun its next flight
            assert np.array_equal(observation, observations[1])
            assert np.array_equal(info["pose"], infos["pose"][1])
    finally:
        single.close()


def test_gusts_and_noise_follow_the_seed_and_the_learner_sees_the_truth() -> None:
    """The same seed in the same environment: the same flight; the estimate is not where it is."""
    env = make(body_options={"gusts": 1.0, "noise": True})
    try:
        ways = []
        for seed in (0, 0, 1):
            env.reset(seed=seed, options={"start": 0})
            ways.append([env.step(STRAIGHT)[4]["pose"] for _ in range(6)])
        assert np.array_equal(ways[0], ways[1])
        assert not np.allclose(ways[0], ways[2], atol=0.01)
        body = env._bodies[0]
        state = body._client.connect()
        error = np.subtract(state.position, state.true_position)
        assert 0.01 < np.abs(error).max() < 1.0
        seen = env.pose[:3] - np.array(body._home[:3])
        assert seen == pytest.approx(state.true_position, abs=1e-6)
    finally:
        env.close()


def test_a_wall_ends_the_flight_and_the_next_begins_at_a_start(envs: Any) -> None:
    envs.reset(seed=0)
    for _ in range(120):
        *_, crashed, _, infos = envs.step(np.full(2, STRAIGHT))
        if crashed.any():
            break
    i = int(np.argmax(crashed))
    assert infos["final_info"]["distance"][i] > 1.0
    nearest = np.abs(envs._flights.scenes[i].starts[:, :3] - infos["pose"][i, :3]).max(axis=1).min()
    assert nearest < 0.01


def test_its_process_ends_with_the_environment() -> None:
    env = make()
    pid = env._bodies[0]._process.pid
    assert not gone(pid)
    env.close()
    until(lambda: gone(pid), "the vehicles' process ends")


PARENT = """
import gymnasium
env = gymnasium.make("sim:IndoorFlight-v0", body="mavlink").unwrapped
print(env._bodies[0]._process.pid, flush=True)
input()
"""


def test_it_ends_also_when_its_parent_is_killed() -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", "if __name__ == '__main__':" + PARENT.replace("\n", "\n    ")],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert parent.stdout is not None
    try:
        pid = int(parent.stdout.readline())
        assert os.getpgid(pid) == os.getpgid(parent.pid)  # of the agent's process group
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait(10)
    until(lambda: gone(pid), "the vehicles' process ends")
