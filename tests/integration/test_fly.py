"""``swarm fly`` with a vehicle that feels the walls: whole flights of real processes."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest
from pymavlink import mavutil
from rerun.chunk import RrdReader

from agent.learning.pilot import Form, Pilot
from agent.learning.policies import C3F2
from sim.vehicle.flavours import ARDUPILOT, PX4
from sim.vehicle.server import Options
from tests.integration.harness import Command, swarm
from tests.integration.vehicles import HOST, vehicle
from tests.notices import without_notices

pytestmark = [pytest.mark.integration, pytest.mark.timeout(900)]
SPEED = 4.0  # simulated seconds per second
SCENE = "indoor-long"
PATIENT = 800.0  # s; a loaded machine takes minutes to start a process


@pytest.fixture(params=[PX4, ARDUPILOT], ids=lambda flavour: flavour.name)
def options(request: pytest.FixtureRequest) -> Iterator[Options]:
    with vehicle(Options(flavour=request.param, speed=SPEED, scene=SCENE)) as running:
        yield running


def connection(options: Options) -> str:
    return f"udpin:{HOST}:{options.port}"


def summary(folder: Path) -> dict[str, Any]:
    return msgspec.json.decode((folder / "flight.json").read_bytes(), type=dict[str, Any])


def fly(*arguments: str | Path, cwd: Path) -> tuple[int, Command]:
    """``swarm fly`` to its end, which takes its time."""
    with swarm("fly", *arguments, cwd=cwd) as command:
        try:
            return command.wait(PATIENT), command
        except subprocess.TimeoutExpired:
            raise AssertionError(f"still flying: {command.output}") from None


def test_two_flights_end_at_walls_and_are_recorded(options: Options, tmp_path: Path) -> None:
    folder = tmp_path / "flight"
    code, ended = fly(
        "--pilot", "straight", "--vehicle", connection(options), "--scene", SCENE,
        "--flights", "2", "--json", "--out", folder, cwd=tmp_path,
    )  # fmt: skip
    assert code == 0, ended.output
    told = summary(folder)
    assert json.loads(ended.answer) == told
    first, second = told["distances"]
    assert 6.0 < first < 12.0  # from the start straight to the opposite wall, less 1.4 m
    assert 1.0 < second < 8.0  # from 4 m back
    assert told["ended"] == "all flights flown"

    tape = mavutil.mavlink_connection(str(folder / "flight.tlog"), dialect="common")
    kinds: dict[str, int] = {}
    while (message := tape.recv_match()) is not None:
        kinds[message.get_type()] = kinds.get(message.get_type(), 0) + 1
    assert kinds["HEARTBEAT"] > 5 and kinds["LOCAL_POSITION_NED"] > 50
    assert kinds["SET_POSITION_TARGET_LOCAL_NED"] > 50  # both directions are on the tape

    drawn = {str(c.entity_path) for c in RrdReader(folder / "flight.rrd").stream().to_chunks()}
    assert {"/world/room", "/world/drone", "/world/drone/eye", "/world/trail", "/log"} <= drawn


def test_a_learned_policy_flies_until_ctrl_c(options: Options, tmp_path: Path) -> None:
    policy, folder = tmp_path / "policy.safetensors", tmp_path / "flight"
    form = Form(C3F2(), (103, 103, 3), "uint8", 25, critic=True)
    size = form.network().theta.numel()
    random = np.random.default_rng(0)
    Pilot(form, (0.01 * random.standard_normal(size)).astype(np.float32)).save(policy)
    with swarm(
        "fly", policy, "--stochastic", "--vehicle", connection(options), "--scene", SCENE,
        "--out", folder, cwd=tmp_path,
    ) as command:  # fmt: skip
        command.says("in the air", PATIENT)
        _fly_a_little(command, folder)
        command.interrupt()
        command.says("landing: told to stop", PATIENT)
        assert command.wait(PATIENT) == 0, command.output
        assert "landed" in command.output
    assert summary(folder)["ended"] == "told to stop"


def _fly_a_little(command: Command, folder: Path) -> None:
    from tests.integration.harness import until

    tape = folder / "flight.tlog"
    before = tape.stat().st_size
    until(lambda: tape.stat().st_size > before + 30_000, "some more telemetry", PATIENT)
    assert command.process.poll() is None, command.output


def test_a_policy_that_says_nothing_sensible_does_not_take_off(
    options: Options, tmp_path: Path
) -> None:
    policy, folder = tmp_path / "policy.safetensors", tmp_path / "flight"
    form = Form(C3F2(), (103, 103, 3), "uint8", 25, critic=False)
    size = form.network().theta.numel()
    Pilot(form, np.full(size, np.nan, np.float32)).save(policy)
    code, ended = fly(
        policy, "--vehicle", connection(options), "--scene", SCENE, "--out", folder,
        cwd=tmp_path,
    )  # fmt: skip
    assert code == 5, ended.output
    assert without_notices(ended.output) == "swarm: the policy's preferences are not numbers"


def test_training_in_real_time_begins_where_the_drone_is(options: Options) -> None:
    """The same environment over somebody else's autopilot: no lockstep, nothing teleported."""
    env = gymnasium.make(
        "sim:IndoorFlight-v0", scene=SCENE, body="agent.vehicle.body:vehicle_bodies",
        body_options={"vehicle": connection(options), "speed": 0.5, "limits": {"fence": 50.0}},
        disable_env_checker=True,
    )  # fmt: skip
    try:
        _, info = env.reset(seed=0, options={"start": 5})  # far from where it stands
        assert info["pose"][:3] == pytest.approx((4.0, 2.3, -1.5), abs=0.5)
        for _ in range(6):
            *_, crashed, _, info = env.step(np.int64(12))
            assert not crashed
        assert info["pose"][0] == pytest.approx(4.0 + 6 * 0.4, abs=0.8)
        _, again = env.reset()  # back on the way that it has come
        assert again["pose"][:3] == pytest.approx((4.0, 2.3, -1.5), abs=0.6)
    finally:
        env.close()
