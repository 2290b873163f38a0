"""The command line without a network: help everywhere, one line for a mistake."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer.main

from deploy.cli import main as cli

ROOT = Path(__file__).parents[3]
FILE = ROOT / "deploy" / "library" / "swarms" / "gridworld-a.toml"
CARTPOLE = FILE.with_name("cartpole.toml")
TORCHES = {  # modules of ours that import torch
    f"agent.learning.{name}" for name in ("neural", "networks", "flat", "pilot")
} | {"deploy.policies.export"}
Run = Callable[..., tuple[int, str, str]]


def commands() -> dict[str, Any]:
    """Every command by its words."""
    found: dict[str, Any] = {}

    def walk(words: str, command: Any) -> None:
        found[words] = command
        for name, inner in getattr(command, "commands", {}).items():
            walk(f"{words} {name}".strip(), inner)

    walk("", typer.main.get_command(cli.app))
    return found


@pytest.mark.parametrize("words", commands())
def test_help_is_whole_and_every_option_has_a_text(words: str, swarm: Run) -> None:
    code, out, err = swarm(*words.split(), "--help")
    assert (code, err) == (0, "")
    assert f"Usage: swarm {words}".strip() in out
    assert not [line for line in out.splitlines()[1:] if line.endswith("...")]
    command = commands()[words]
    assert command.help
    for parameter in command.params:
        assert getattr(parameter, "help", None), f"{words}: {parameter.name}"


def test_the_version(swarm: Run) -> None:
    assert swarm("--version") == (0, "swarm 0.1.0\n", "")


def test_topology_prints_w_and_its_spectrum(swarm: Run) -> None:
    _, out, _ = swarm("topology", FILE, "--set", 'topology={kind="complete"}', "--json")
    summary = json.loads(out)
    assert len(summary["edges"]) == 6
    assert summary["W"][0] == pytest.approx([0.5] + [1 / 6] * 3)
    assert summary["spectrum"]["gap"] == pytest.approx(2 / 3)
    assert "spectral gap 0.5000" in swarm("topology", FILE)[1]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["up"], 2, "expected either FILE or --resume RUN"),
        (["up", "--nope"], 2, "--nope"),
        (["nope"], 2, "'nope'"),
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
        (["up", FILE, "--device", "cuda"], 2, '--device cuda: policy.kind = "tabular" needs none'),
        (["up", FILE, "--device", "tpu"], 2, '--device "tpu": expected cpu or cuda'),
        (["agent", FILE, "--id", "drone0", "--device", "cuda"], 2, "needs none"),
        (["view", FILE, "--seconds", "-3"], 2, "'--seconds'"),
        (["view", FILE, "--seconds", "nan"], 2, "'--seconds'"),
        (["status", FILE, "--timeout", "-1"], 2, "'--timeout'"),
        (["doctor", FILE, "--timeout", "inf"], 2, "'--timeout'"),
        (["fly", "--vehicle", "udpin:127.0.0.1:21999", "--battery", "7"], 2, "'--battery'"),
        (["export", ".", "--to", "/nodir/x.onnx"], 2, 'there is no folder "/nodir"'),
        (["export", ".", "--to", "x.onnx", "--format", "safetensors"], 2, "a name in"),
        (["export", ".", "--to", "x.pt"], 2, "ends in .safetensors or .onnx"),
        (["export", ".", "--format", "pt"], 2, "expected safetensors or onnx"),
        (["export", ".", "--to", "p.onnx"], 2, '"." is not a run folder'),
    ],
)
def test_a_mistake_is_one_line_and_an_exit_code(
    tmp_path: Path, arguments: list[str], code: int, words: str, swarm: Run
) -> None:
    ended, out, err = swarm(*arguments)
    assert (ended, out) == (code, "")
    assert words in err
    assert len(err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())  # nothing was begun


def test_an_agent_needs_neither_torch_nor_rerun() -> None:
    code = (
        "import sys; sys.modules['torch'] = sys.modules['rerun'] = None\n"
        "import deploy.cli.main, agent.daemon.process, agent.learning.tabular\n"
        "import deploy.launch.up, deploy.observe.status"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=60, check=False)
    assert done.returncode == 0


@pytest.mark.parametrize("arguments", [("up", CARTPOLE), ("export", ".")], ids=str)
def test_without_torch_one_line_says_what_to_install(
    arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, swarm: Run
) -> None:
    for name in [n for n in sys.modules if n.split(".")[0] == "torch" or n in TORCHES]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)
    code, out, err = swarm(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("swarm: this needs torch, which is not installed: ")
    assert 'pip install "torch>=' in err
    assert len(err.splitlines()) == 1


def test_standard_output_is_the_answer_and_nothing_else(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RUST_LOG", "debug")  # as ROS 2 users have it
    settings = ["--set", "name=nobody-here", "--set", "network.base_port=1"]
    arguments = ["status", str(FILE), "--json", "--timeout", "0.1", *settings]
    monkeypatch.setattr(sys, "argv", ["swarm", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 3
    assert json.loads(capfd.readouterr().out)["health"] == "nobody"
