"""A swarm from start to end: what it prints, what it leaves, how it stops, dies and comes back."""

import json
import os
import signal
import time
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

import numpy as np
import pytest

from agent.storage.runfolder import RunFolder
from deploy.process.ports import is_free
from tests.integration.harness import (
    GRIDWORLD_A,
    MEMBERS,
    Command,
    agent_pids,
    final_thetas,
    free_base_port,
    rounds_played,
    run,
    status,
    swarm,
    until,
)

pytestmark = pytest.mark.integration
SHM = "/dev/shm/"  # noqa: S108  (shared memory of the whole machine is meant)


def ports_are_free(folder: Path) -> bool:
    base = json.loads((folder / "config.json").read_text())["network"]["base_port"]
    return all(is_free("127.0.0.1", port) for port in range(base, base + len(MEMBERS)))


def shared_memory_of(pid: int) -> set[Path]:
    """Segments that a process has mapped; others on this machine have theirs."""
    maps = Path(f"/proc/{pid}/maps").read_text(encoding="utf-8").splitlines()
    return {Path(line.split()[-1]) for line in maps if line.split()[-1].startswith(SHM)}


def test_make_run_solves_all_tasks_and_leaves_a_complete_run_folder(tmp_path: Path) -> None:
    code, output = run("up", GRIDWORLD_A, cwd=tmp_path)
    assert code == 0, output
    assert "tasks solved: 4 of 4 by every agent's policy" in output
    folder = RunFolder((tmp_path / "runs" / "latest").resolve())
    assert folder.path.name in output
    result = json.loads(folder.result.read_text())["scores"]
    assert result["solved"] == [4, 4, 4, 4]
    goal, obstacle = np.array(result["goal"]), np.array(result["obstacle"])
    assert (goal - obstacle > 0.5).all()
    assert ((goal >= 0) & (obstacle >= 0) & (goal + obstacle <= 1 + 1e-9)).all()
    assert min(result["value"]) / result["optimum"] > 0.9
    assert json.loads((folder.path / "versions.json").read_text())["numpy"]
    for agent in MEMBERS:
        reports = list(folder.reports(agent))
        assert [report.round for report in reports] == list(range(1000))
        assert all(len(report.weights) == 2 and not report.missing for report in reports)
        assert "finished" in folder.log(agent).read_text()
    assert folder.recording.stat().st_size > 10_000
    assert not agent_pids(folder.path)


def test_swarms_started_together_all_finish_each_in_a_folder_of_its_own(tmp_path: Path) -> None:
    with ExitStack() as running:
        commands = [
            running.enter_context(
                swarm(
                    *("up", GRIDWORLD_A, "--no-record", "--set", "rounds=20"),
                    *("--set", f"seed={seed}"),
                    cwd=tmp_path,
                )
            )
            for seed in range(4)
        ]
        for command in commands:
            assert command.wait(120.0) == 0, command.output
    folders = [path for path in (tmp_path / "runs").iterdir() if not path.is_symlink()]
    configs = [json.loads((path / "config.json").read_text()) for path in folders]
    assert {config["seed"] for config in configs} == set(range(4))
    assert len({config["network"]["base_port"] for config in configs}) == 4


def test_ctrl_c_ends_all_and_resume_goes_on_bit_for_bit(tmp_path: Path) -> None:
    settings = ["--set", "rounds=700", "--set", "seed=5", "--no-record"]
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    assert run("up", GRIDWORLD_A, "--run", whole, *settings, cwd=tmp_path)[0] == 0
    with swarm("up", GRIDWORLD_A, "--run", cut, *settings, cwd=tmp_path) as command:
        until(lambda: min(rounds_played(cut, m) for m in MEMBERS) > 30, "round 30")
        pids = agent_pids(cut)
        assert set(pids) == set(MEMBERS)
        segments = set().union(*map(shared_memory_of, pids.values()))
        assert segments
        start = time.monotonic()
        command.interrupt()
        assert command.wait() == 130, command.output
        assert time.monotonic() - start < 10  # the promise is 2 s; this machine may be loaded
    assert f"swarm up --resume {cut}" in command.output
    assert not agent_pids(cut)
    assert ports_are_free(cut)
    until(lambda: not any(map(Path.exists, segments)), "no segment of shared memory is left")
    for agent in MEMBERS:
        assert "told to stop, checkpoint written" in RunFolder(cut).log(agent).read_text()
    code, output = run("up", "--resume", cut, "--no-record", cwd=tmp_path)
    assert code == 0, output
    np.testing.assert_array_equal(final_thetas(cut), final_thetas(whole))
    for agent in MEMBERS:
        assert [r.round for r in RunFolder(cut).reports(agent)] == list(range(700))


def test_a_killed_agent_is_reported_restarted_and_joins_again(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with swarm(
        "up", GRIDWORLD_A, "--run", folder, "--no-record", "--set", "rounds=4000", cwd=tmp_path
    ) as command:
        until(lambda: rounds_played(folder, "drone1") > 1000, "round 1000")
        os.kill(agent_pids(folder)["drone1"], signal.SIGKILL)
        command.says("drone1 was killed by SIGKILL, starts again in")
        command.says("drone1 starts again from its newest checkpoint")
        before = rounds_played(folder, "drone0")
        until(lambda: rounds_played(folder, "drone0") > before, "the others go on")
        assert command.wait() == 0, command.output
    assert "tasks solved: 4 of 4 by every agent's policy" in command.output
    log = RunFolder(folder).log("drone1").read_text()
    assert "joining at round" in log
    last = list(RunFolder(folder).reports("drone0"))[-1]
    assert set(last.weights) == {"drone1", "drone3"}
    # While drone1 was away its neighbours closed the ring.
    assert any(set(r.weights) == {"drone2", "drone3"} for r in RunFolder(folder).reports("drone0"))


def test_status_tells_healthy_degraded_and_nobody(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with swarm(
        "up", GRIDWORLD_A, "--run", folder, "--no-record", "--set", "rounds=1000000", cwd=tmp_path
    ) as command:
        command.says("first round")
        until(lambda: min(rounds_played(folder, m) for m in MEMBERS) > 5, "round 5")
        code, summary = status(folder, tmp_path)
        assert (code, summary["health"]) == (0, "healthy"), summary
        assert set(summary["agents"]) == set(MEMBERS)
        assert summary["consensus_error"] >= 0
        drone0 = summary["agents"]["drone0"]
        assert set(drone0["neighbours"]) == {"drone1", "drone3"}
        assert drone0["round"] > 0
        frozen = agent_pids(folder)["drone3"]
        os.kill(frozen, signal.SIGSTOP)
        try:
            code, summary = status(folder, tmp_path, timeout=2.0)
        finally:
            os.kill(frozen, signal.SIGCONT)
        assert (code, summary["health"]) == (1, "degraded")
        assert "drone3 does not answer" in summary["problems"]
    code, summary = status(folder, tmp_path, timeout=0.5)
    assert (code, summary["health"], summary["agents"]) == (1, "ended", {})
    assert summary["result"]["state"] == "interrupted"
    assert "interrupted after" in run("status", folder, cwd=tmp_path)[1]
    RunFolder(folder).result.unlink()  # as if the launcher had been killed
    code, summary = status(folder, tmp_path, timeout=0.5)
    assert (code, summary["health"], summary["agents"]) == (3, "nobody", {})
    assert "the run told no end" in run("status", folder, cwd=tmp_path)[1]


def test_single_agents_make_a_swarm_and_an_id_is_taken_once(tmp_path: Path) -> None:
    """`swarm agent` by hand, as drones would; the last one joins a swarm that is under way."""
    port = f"network.base_port={free_base_port(4)}"
    common = ["--set", port, "--set", "rounds=1000000", "--set", "timing.start=0.5"]
    folders = {m: tmp_path / m for m in MEMBERS}

    def start(member: str) -> AbstractContextManager[Command]:
        return swarm(
            "agent", GRIDWORLD_A, "--id", member, "--run", folders[member], *common, cwd=tmp_path
        )

    with start("drone0") as first, start("drone1"), start("drone2"):
        until(lambda: rounds_played(folders["drone0"], "drone0") > 20, "round 20")
        with start("drone3") as last:
            last.says("joining at round")
            until(lambda: rounds_played(folders["drone3"], "drone3") > 3, "drone3 takes part")
            reports = list(RunFolder(folders["drone3"]).reports("drone3"))
            assert reports[0].round > 10
            assert set(reports[-1].weights) == {"drone0", "drone2"}
            again = folders["drone3"].with_name("again")
            code, output = run(
                "agent", GRIDWORLD_A, "--id", "drone3", "--run", again, *common, cwd=tmp_path
            )
            assert code == 3
            assert "swarm: " in output.splitlines()[-1]
            assert "Traceback" not in output
        first.interrupt()
        assert first.wait() == 0


def test_agents_find_each_other_by_multicast(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, output = run(
        *("up", GRIDWORLD_A, "--run", folder, "--no-record", "--set", "rounds=30"),
        *("--set", "network.discovery=multicast", "--set", "network.multicast_interface=lo"),
        cwd=tmp_path,
    )
    assert code == 0, output
    for agent in MEMBERS:
        assert all(len(report.weights) == 2 for report in RunFolder(folder).reports(agent))


def test_an_agent_does_not_overwrite_an_earlier_run(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    settings = ["--set", "rounds=5", "--no-record"]
    assert run("up", GRIDWORLD_A, "--run", folder, *settings, cwd=tmp_path)[0] == 0
    code, output = run("up", GRIDWORLD_A, "--run", folder, *settings, cwd=tmp_path)
    assert code == 2
    assert "is in use" in output
    code, output = run("agent", GRIDWORLD_A, "--id", "drone0", "--run", folder, cwd=tmp_path)
    assert code == 2
    assert "--resume" in output
