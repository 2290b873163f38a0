"""The command line without a network: help everywhere, one line for a mistake."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FILE = ROOT / "deploy" / "library" / "swarms" / "gridworld-a.toml"
COMMANDS = [
    "up", "agent", "status", "view", "topology", "reproduce", "doctor", "certs", "worlds", "fly",
    "vehicle",
]  # fmt: skip


def swarm(*arguments: str | Path, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "deploy.cli", *map(str, arguments)],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_help_names_every_command_and_each_has_its_own() -> None:
    overview = swarm("--help").stdout
    for command in COMMANDS:
        assert command in overview
        assert "Usage: " in swarm(command, "--help").stdout


def test_topology_prints_w_and_its_spectrum() -> None:
    printed = swarm("topology", FILE, "--set", 'topology={kind="complete"}', "--json")
    summary = json.loads(printed.stdout)
    assert len(summary["edges"]) == 6
    assert summary["W"][0] == pytest.approx([0.5] + [1 / 6] * 3)
    assert summary["spectrum"]["gap"] == pytest.approx(2 / 3)
    assert "spectral gap 0.5000" in swarm("topology", FILE).stdout


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["up", "missing.toml"], 2, '"missing.toml" does not exist'),
        (["up", FILE, "--set", "rounds=x"], 2, 'rounds = "x": expected int'),
        (["up", FILE, "--set", "agents.0.task.kwargs.layout=z"], 2, "expected one of a, b, c"),
        (["up", FILE, "--set", "agents.0.task.env=sim:Nope-v0"], 2, "sim:Nope-v0"),
        (["up", FILE, "--set", "agents.0.task.env=CartPole-v1"], 2, "CartPole-v1"),
        (
            ["up", FILE, "--set", "agents.0.task.kwargs={size=[3,3],goals=[[2,2]]}"],
            2,
            "for one common policy",
        ),
        (["up", "--resume", "."], 2, '"." is not a run folder'),
        (["agent", FILE, "--id", "drone9"], 2, 'no agent "drone9"'),
        (["status"], 2, "no run in"),
        (["view"], 2, "no run in"),
        (["fly", "--pilot", "ace"], 2, "ace"),
        (["fly", "--scene", "missing.glb"], 2, "missing.glb"),
        (["worlds", "--scene", "nowhere"], 2, "nowhere"),
    ],
)
def test_a_mistake_is_one_line_and_an_exit_code(
    tmp_path: Path, arguments: list[str], code: int, words: str
) -> None:
    done = swarm(*arguments, cwd=tmp_path)
    assert done.returncode == code
    assert words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())  # nothing was begun


def test_an_agent_needs_neither_torch_nor_rerun() -> None:
    code = (
        "import sys; sys.modules['torch'] = sys.modules['rerun'] = None\n"
        "import deploy.cli.main, agent.daemon.process, agent.learning.tabular\n"
        "import deploy.launch.up, deploy.observe.status"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=60, check=False)
    assert done.returncode == 0
