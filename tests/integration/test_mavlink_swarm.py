"""``drones-mavlink.toml``: four agents learn through four MAVLink vehicles."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder
from tests.integration.harness import SWARMS, agent_pids, swarm, until

pytestmark = [pytest.mark.integration, pytest.mark.timeout(600)]
AGENTS = ("drone0", "drone1", "drone2", "drone3")
ROUNDS = 3


def vehicles_of(agents: set[int]) -> dict[int, int]:
    """Vehicle processes that run for these agents: pid -> its agent's pid."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            words = (entry / "cmdline").read_bytes().decode().split("\0")
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if "sim.vehicle.fleet" in words and parent in agents:
            found[int(entry.name)] = parent
    return found


def alive(pid: int) -> bool:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def test_it_trains_and_leaves_nothing_behind(tmp_path: Path) -> None:
    run = tmp_path / "run"
    settings = [f"rounds={ROUNDS}", "training.segment=48", "checkpoint_every=1"]
    arguments = [part for setting in settings for part in ("--set", setting)]
    with swarm(
        "up", SWARMS / "drones-mavlink.toml", "--run", run, "--no-record", *arguments, cwd=tmp_path
    ) as command:
        until(lambda: len(agent_pids(run)) == 4, "four agents", 240.0)
        agents = set(agent_pids(run).values())
        until(lambda: len(vehicles_of(agents)) == 4, "four vehicle processes", 240.0)
        vehicles = vehicles_of(agents)
        assert set(vehicles.values()) == agents  # one each
        assert all(os.getpgid(pid) == os.getpgid(agent) for pid, agent in vehicles.items())
        assert command.wait(500.0) == 0, command.output
    until(lambda: not any(map(alive, vehicles)), "the vehicles have ended")
    folder = RunFolder(run)
    for agent in AGENTS:
        reports = list(folder.reports(agent))
        assert [report.round for report in reports] == list(range(ROUNDS))
        assert reports[-1].steps == 48 * ROUNDS
        assert reports[-1].gradient_norm > 0
        held = folder.checkpoints(agent)
        first, last = (
            checkpoint.read(checkpoint.path_of(held, round_)).theta for round_ in (1, ROUNDS)
        )
        assert not np.array_equal(first, last)


def test_a_killed_agent_takes_its_vehicle_along(tmp_path: Path) -> None:
    run = tmp_path / "run"
    with swarm(
        "up", SWARMS / "drones-mavlink.toml", "--run", run, "--no-record",
        "--set", "training.segment=16", cwd=tmp_path,
    ) as command:  # fmt: skip
        until(lambda: len(agent_pids(run)) == 4, "four agents", 240.0)
        agents = agent_pids(run)
        until(lambda: len(vehicles_of(set(agents.values()))) == 4, "their vehicles", 240.0)
        (mine,) = vehicles_of({agents["drone2"]})
        os.kill(agents["drone2"], signal.SIGKILL)
        until(lambda: not alive(mine), "its vehicle has ended")
        until(lambda: agent_pids(run).get("drone2", 0) != agents["drone2"], "a new one", 240.0)
        command.interrupt()
        command.wait(120.0)
