"""Newcomers: one without a swarm file, one that means something else, and one of another swarm."""

from pathlib import Path

from agent.config.experiment import load
from agent.storage.runfolder import RunFolder
from tests.integration.harness import GRIDWORLD_A, free_base_port, rounds_played, run, swarm, until


def test_a_newcomer_gets_the_file_and_strangers_are_refused_on_both_sides(tmp_path: Path) -> None:
    port = free_base_port(6)
    common = [
        *("--set", f"network.base_port={port}", "--set", "rounds=1000000"),
        *("--set", "timing.start=0.3", "--set", "quorum.minimum=0"),
        *("--set", "policy.precision=float64"),
    ]
    there, log = tmp_path / "there", RunFolder(tmp_path / "there").log("drone0")
    asked = [f"tcp/127.0.0.1:{port}"]
    with swarm(
        "agent", GRIDWORLD_A, "--id", "drone0", "--run", there, *common, cwd=tmp_path
    ) as first:
        until(lambda: rounds_played(there, "drone0") > 20, "round 20")

        # Without a file: everything comes from the one who is there.
        came = tmp_path / "came"
        newcomer: list[str | Path] = [
            "--id",
            "drone1",
            "--run",
            came,
            "--join",
            "gridworld-a",
            "--connect",
            *asked,
        ]
        with swarm("agent", *newcomer, cwd=tmp_path) as second:
            second.says("configuration from drone0 in round")
            second.says("with the parameters of drone0")
            until(lambda: rounds_played(came, "drone1") > 3, "drone1 takes part")
            assert load(RunFolder(came).config).policy.precision == "float64"
            reports = list(RunFolder(came).reports("drone1"))
            assert reports[0].round > 20
            assert reports[-1].weights.keys() == {"drone0"}

        # Another layout: refused in one line, there and here.
        other: list[str | Path] = ["--id", "drone2", "--run", tmp_path / "other", *common[:-1]]
        code, said = run("agent", GRIDWORLD_A, *other, "policy.precision=float32", cwd=tmp_path)
        assert code == 3, said
        line = said.splitlines()[-1]
        assert line.startswith(
            'swarm: swarm "gridworld-a" refuses us: drone0 differs in policy.precision'
        )
        assert '= "float64", we "float32": expected' in line
        until(
            lambda: 'refused: drone2 differs in policy.precision = "float32"' in log.read_text(),
            "the other side",
        )
        assert "drone2" not in {m for r in RunFolder(there).reports("drone0") for m in r.weights}

        # Another swarm: each says once who the other is, and both go on.
        stranger: list[str | Path] = [
            "--id",
            "drone3",
            "--run",
            tmp_path / "stranger",
            *common,
            "--set",
            "name=b",
        ]
        with swarm("agent", GRIDWORLD_A, *stranger, cwd=tmp_path) as third:
            third.says('another swarm is on this network, "gridworld-a"')
            until(lambda: 'another swarm is on this network, "b"' in log.read_text(), "the other")
            until(lambda: rounds_played(tmp_path / "stranger", "drone3") > 3, "b goes on alone")
        first.interrupt()
        assert first.wait() == 0


def test_nobody_to_join_is_one_line(tmp_path: Path) -> None:
    nowhere = f"tcp/127.0.0.1:{free_base_port(1)}"
    code, said = run(
        *("agent", "--id", "drone1", "--join", "gridworld-a", "--connect", nowhere), cwd=tmp_path
    )
    assert code == 3
    assert said == (
        f'swarm: nobody of swarm "gridworld-a" answers at {nowhere} within 3 s: '
        "expected a running agent, see swarm doctor"
    )
