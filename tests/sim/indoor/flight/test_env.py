"""The environments: Gymnasium's own checks, hand numbers of the motion, single against vector."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from sim.indoor.errors import PoseError
from sim.indoor.flight.body import Body, KinematicBody, Pose, SetPoint
from sim.indoor.flight.env import IndoorFlight
from sim.indoor.flight.flights import PITCH_STEP, YAW_STEP, aim
from sim.indoor.render.camera import Camera, Renderer
from tests.sim.indoor.content.test_userfile import hall

SCENE = "indoor-pyramid"
ID = "sim:IndoorFlight-v0"


def make(**arguments: Any) -> Any:
    return gymnasium.make(ID, **({"scene": SCENE} | arguments)).unwrapped


def make_vec(count: int, **arguments: Any) -> Any:
    return gymnasium.make_vec(
        ID, num_envs=count, vectorization_mode="vector_entry_point",
        **({"scene": SCENE} | arguments),
    )  # fmt: skip


def test_gymnasium_finds_nothing_to_complain_about(recwarn: pytest.WarningsRecorder) -> None:
    check_env(make(render_mode="rgb_array"))
    assert [str(w.message) for w in recwarn if "UserWarning" in str(w.category)] == []


@pytest.mark.parametrize(
    ("action", "right", "descent"), [(12, 0, 0), (14, 2, 0), (10, -2, 0), (2, 0, -2), (22, 0, 2)]
)
def test_where_an_action_leads(action: int, right: int, descent: int) -> None:
    """Heading east at 1.5 m: 10.667 degrees and 6 degrees a step, 0.4 m ahead."""
    target = np.empty(4)
    aim(np.array([3.0, 4.0, -1.5, 0, 0, np.pi / 2]), action, np.zeros(2), target)
    yaw = np.pi / 2 + np.radians(right * 80 / 1.5 / 5)
    assert target[3] == pytest.approx(yaw)
    assert target[0] == pytest.approx(3.0 + 0.4 * np.cos(yaw))
    assert target[1] == pytest.approx(4.0 + 0.4 * np.sin(yaw))
    assert target[2] == pytest.approx(-1.5 + 0.4 * np.sin(np.radians(6.0 * descent)))


def test_noise_is_a_sixth_of_a_step_either_way() -> None:
    low, high = np.empty(4), np.empty(4)
    pose = np.array([0.0, 0, -1.5, 0, 0, 0])
    aim(pose, 12, np.array([-1.0, -1.0]), low)
    aim(pose, 12, np.array([1.0, 1.0]), high)
    assert high[3] == pytest.approx(YAW_STEP / 6) and low[3] == pytest.approx(-YAW_STEP / 6)
    assert high[2] - low[2] == pytest.approx(0.8 * np.sin(PITCH_STEP / 6))


def test_the_heading_stays_within_half_a_turn() -> None:
    target = np.empty(4)
    aim(np.array([0.0, 0, -1.5, 0, 0, np.pi - 0.01]), 14, np.zeros(2), target)
    assert -np.pi <= target[3] <= np.pi


def test_distance_counts_horizontal_metres() -> None:
    env = make()
    env.reset(seed=3, options={"start": 0})
    for k in range(5):
        _, _, terminated, _, info = env.step(2 + 5 * (k % 5))  # climbing and sinking: no matter
        assert not terminated
        assert info["distance"] == pytest.approx(0.4 * (k + 1))


def test_a_wall_ends_the_flight() -> None:
    """1.8 m before the north wall of 30 m: the second step comes nearer than 1.37 m."""
    env = make()
    env.reset(seed=0, options={"pose": (30 - 1.75, 20.0, -1.5, 0.0)})
    _, reward, terminated, truncated, _ = env.step(12)
    assert terminated and not truncated and reward == -1.0


def test_contact_stops_the_drone_at_the_surface() -> None:
    """Sideways along a wall, 0.3 m from it, and into it: touched before the camera sees it near."""
    env = make()
    env.reset(seed=0, options={"pose": (30 - 0.3, 20.0, -1.5, np.pi / 2 - 0.3)})
    *_, terminated, _, info = env.step(12)
    assert terminated and info["touched"]
    assert info["pose"][0] == pytest.approx(30 - 0.25, abs=1e-6)
    assert 0 < info["distance"] < 0.4


def test_same_seed_same_flight() -> None:
    first, second = make(), make()
    assert np.array_equal(first.reset(seed=5)[0], second.reset(seed=5)[0])
    for action in (12, 13, 11, 7, 17):
        a, b = first.step(action), second.step(action)
        assert np.array_equal(a[0], b[0]) and a[1:4] == b[1:4]
        assert np.array_equal(a[4]["pose"], b[4]["pose"])
    other = make()
    other.reset(seed=6, options={"start": 0})
    assert not np.array_equal(other.step(12)[4]["pose"], first.pose)


def test_vector_is_single_step_by_step() -> None:
    """Two scenes dealt out to four flights: each is the single flight with its seed."""
    scenes = [SCENE, "indoor-techno"]
    vector = make_vec(4, scene=scenes, max_steps=9)
    singles = [make(scene=scenes[i % 2], max_steps=9) for i in range(4)]
    observations, _ = vector.reset(seed=11)
    for i, single in enumerate(singles):
        assert np.array_equal(single.reset(seed=11 + i)[0], observations[i])
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(25):
        actions = rng.integers(25, size=4)
        observations, rewards, terminated, truncated, infos = vector.step(actions)
        for i, single in enumerate(singles):
            seen, reward, dead, late, info = single.step(actions[i])
            assert (reward, dead, late) == (rewards[i], terminated[i], truncated[i])
            if dead or late:
                ended += 1
                assert np.array_equal(infos["final_obs"][i], seen)
                assert infos["final_info"]["distance"][i] == info["distance"]
                assert infos["_final_info"][i] and infos["_final_obs"][i]
                seen, info = single.reset()
            assert np.array_equal(observations[i], seen)
            assert np.array_equal(vector.depth[i], single.depth)
            assert np.array_equal(infos["pose"][i], info["pose"])
    assert ended > 4


def test_same_step_autoreset() -> None:
    vector = make_vec(3, max_steps=2)
    assert vector.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    before, _ = vector.reset(seed=0)
    kept = before.copy()
    _, _, terminated, truncated, infos = vector.step(np.full(3, 12))
    assert np.array_equal(before, kept), "what was handed out is not overwritten"
    assert "final_obs" not in infos or (terminated | truncated).any()
    _, _, terminated, truncated, infos = vector.step(np.full(3, 12))
    assert (truncated & ~terminated).any()
    assert (infos["distance"][truncated] == 0).all()
    assert infos["final_info"]["distance"][truncated] == pytest.approx(0.8)


def test_no_time_limit_unless_asked() -> None:
    vector = make_vec(2)
    vector.reset(seed=0)
    for _ in range(40):
        *_, truncated, _ = vector.step(np.array([10, 14]))
        assert not truncated.any()


def test_reset_mask_leaves_the_others_alone() -> None:
    vector = make_vec(3)
    vector.reset(seed=0)
    observations, *_ = vector.step(np.full(3, 12))
    again, infos = vector.reset(options={"reset_mask": np.array([True, False, False])})
    assert np.array_equal(again[1:], observations[1:])
    assert list(infos["_distance"]) == [True, False, False]


class Drifting:
    """A body that never quite gets there: it stops a quarter short, and reports a tilt."""

    def __init__(self) -> None:
        self.pose = Pose(0, 0, 0)
        self.steps = 0
        self.closed = False
        self.seed = 0

    def place(self, pose: Pose, seed: int) -> None:
        self.pose, self.seed = pose, seed

    def head_for(self, target: SetPoint) -> None:
        x, y = (0.25 * a + 0.75 * b for a, b in zip(self.pose[:2], target[:2], strict=True))
        self.pose = Pose(x, y, target.z, 0.02, -0.05, target.yaw)

    def arrive(self) -> None:
        self.steps += 1

    def close(self) -> None:
        self.closed = True


def test_any_body_may_fly() -> None:
    body = Drifting()
    assert isinstance(body, Body) and isinstance(KinematicBody(), Body)
    env = make(body=body)
    env.reset(seed=1, options={"start": 2})
    info = env.step(12)[4]
    assert info["distance"] == pytest.approx(0.3)
    assert info["pose"][4] == -0.05
    env.close()
    assert body.steps == 1 and body.closed


def test_a_named_kinematic_body_is_the_built_in_one() -> None:
    """The same flight through the protocol and through the compiled short cut."""
    slow, fast = make_vec(2, body=[KinematicBody(), KinematicBody()]), make_vec(2)
    slow.reset(seed=9), fast.reset(seed=9)
    for _ in range(6):
        a, b = slow.step(np.array([11, 13])), fast.step(np.array([11, 13]))
        assert np.array_equal(a[0], b[0]) and np.array_equal(a[1], b[1])
    with pytest.raises(ValueError, match="no body 'glider'"):
        make(body="glider")
    with pytest.raises(ValueError, match="1 bodies for 2 flights"):
        make_vec(2, body=[KinematicBody()])
    with pytest.raises(ValueError, match="expected none with this body"):
        make(body_options={"step": 0.4})
    with pytest.raises(ValueError, match='flavour "paper": expected one of px4, ardupilot'):
        make(body="mavlink", body_options={"flavour": "paper"})


def test_what_is_chance_in_a_body_follows_the_seed() -> None:
    body = Drifting()
    env = make(body=body)
    seeds = []
    for seed in (5, 5, 6):
        env.reset(seed=seed)
        seeds.append(body.seed)
    assert seeds[0] == seeds[1] != seeds[2]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"pose": (np.nan, 1.0, -1.5, 0.0)}, r'options\["pose"\]: x = nan: expected a finite'),
        ({"pose": (2.5, 4.0, -1.5, np.inf)}, "yaw = inf: expected a finite number"),
        ({"pose": (1e30, 1.0, -1.5, 0.0)}, "expected at most 1e"),
        ({"pose": (1.0, 1.0)}, "expected x, y, z, yaw"),
        ({"start": 77}, r'options\["start"\] = 77: expected 0 to'),
        ({"start": -1}, r'options\["start"\] = -1: expected 0 to'),
        ({"stat": 1}, 'reset option "stat": expected "pose" or "start"'),
    ],
)
def test_wrong_reset_options(options: dict[str, Any], said: str) -> None:
    for env in (make(), make_vec(2)):
        with pytest.raises(ValueError, match=said):
            env.reset(seed=0, options=options)


class Ill(Drifting):
    """A body whose estimator has failed."""

    def head_for(self, target: SetPoint) -> None:
        self.pose = Pose(np.nan, np.nan, np.nan)


def test_a_body_that_reports_no_numbers_is_named() -> None:
    env = make(body=Ill())
    env.reset(seed=0)
    with pytest.raises(PoseError, match="the report of body 0: x = nan: expected a finite number"):
        env.step(12)


@pytest.mark.parametrize("action", [25, 999, -7])
def test_an_action_that_is_none(action: int) -> None:
    env, vector = make(), make_vec(2)
    env.reset(seed=0), vector.reset(seed=0)
    with pytest.raises(ValueError, match=f"action {action}: expected 0 to 24"):
        env.step(action)
    with pytest.raises(ValueError, match=f"action {action}: expected 0 to 24"):
        vector.step(np.array([12, action]))
    with pytest.raises(ValueError, match="expected 2 whole numbers"):
        vector.step(np.array([12.0, 12.5]))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"render_mode": "human"}, "render_mode = 'human': expected"),
        ({"max_steps": 0}, "max_steps = 0: expected a whole number from 1 on"),
        ({"max_steps": 2.5}, "max_steps = 2.5: expected a whole number from 1 on"),
    ],
)
def test_arguments_that_are_none(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        IndoorFlight(SCENE, **arguments)
    with pytest.raises(ValueError, match=said):
        make_vec(2, **arguments)


@pytest.mark.parametrize("field", [{"height": 0}, {"hfov": float("nan")}, {"aspect": 0.0}])
def test_a_camera_that_sees_nothing(field: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"camera.{next(iter(field))} = "):
        Camera(**field)


def test_gymnasiums_name_of_the_time_limit() -> None:
    vector = make_vec(1, max_episode_steps=2)
    vector.reset(seed=0, options={"start": 0})
    assert [bool(vector.step(np.array([12]))[3][0]) for _ in range(2)] == [False, True]
    with pytest.raises(ValueError, match="expected one of them"):
        make_vec(2, max_steps=3, max_episode_steps=3)


def test_more_worlds_than_the_cache_keeps(tmp_path: Path) -> None:
    """Ten files dealt out to twelve flights: each is read once, and each flight is in its own."""
    names = []
    for k in range(10):
        names.append(str(tmp_path / f"hall{k}.ply"))
        hall(length=12.0 + k).export(names[-1])
    flights = make_vec(12, scene=names)._flights
    assert flights.mesh.triangles == 10 * hall().faces.shape[0]
    assert list(flights.worlds) == [*range(10), 0, 1]
    assert flights.scenes[10] is flights.scenes[0]


def test_a_renderer_is_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    built = []
    init = Renderer.__init__

    def counted(self: Renderer, *args: Any, **kwargs: Any) -> None:
        built.append(self)
        init(self, *args, **kwargs)

    vector = make_vec(2, render_mode="rgb_array")
    vector.reset(seed=0)
    monkeypatch.setattr(Renderer, "__init__", counted)
    vector.render(), vector.render()
    assert len(built) == 1


def test_rendering() -> None:
    env = make(render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().shape == (180, 320, 3)
    vector = make_vec(2, render_mode="rgb_array")
    vector.reset(seed=0)
    assert [view.shape for view in vector.render()] == [(180, 320, 3)] * 2
