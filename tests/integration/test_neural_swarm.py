"""Swarms whose agents learn with networks: real processes, from the first round to the export."""

import json
from pathlib import Path

import numpy as np
import onnxruntime

from agent.config.experiment import load
from agent.learning.pilot import Pilot
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder
from deploy.policies.evaluation import Evaluation
from tests.integration import harness
from tests.integration.harness import MEMBERS, SWARMS, swarm, until

PATIENCE = 240.0  # [s] torch alone takes a loaded machine a while to import


def run(*arguments: str | Path, cwd: Path) -> tuple[int, str]:
    """Run ``swarm`` to its end, patiently: (exit code, output without notices)."""
    return harness.run(*arguments, cwd=cwd, deadline=PATIENCE)


def short(rounds: int) -> list[str]:
    return ["--no-record", "--set", f"rounds={rounds}"]


def test_cart_poles_learn_stop_go_on_and_leave_the_house(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    own = ["--set", "estimator.mix_critic=false"]
    with swarm(
        "up", SWARMS / "cartpole.toml", "--run", folder.path, *short(60), *own, cwd=tmp_path
    ) as up:
        until(lambda: len(list(folder.reports("drone0"))) > 12, "a dozen rounds", PATIENCE)
        up.interrupt()
        assert up.wait() == 130
    begin = folder.common_round(MEMBERS)
    assert begin
    held = [checkpoint.rounds_in(folder.checkpoints(agent))[-1] for agent in MEMBERS]
    assert max(held) - begin <= 3  # nothing but the last rounds of the fastest is lost
    code, output = run("up", "--resume", folder.path, "--no-record", cwd=tmp_path)
    assert code == 0, output
    assert "51,200" not in output
    newest = [folder.newest(agent) for agent in MEMBERS]
    critics = [kept.optimizer["critic"] for kept in newest]
    assert all(critic.shape == (64 + 1,) for critic in critics)
    assert not np.allclose(critics[0], critics[1])
    thetas = [kept.theta for kept in newest]
    spread = max(float(np.linalg.norm(t - np.mean(thetas, axis=0))) for t in thetas)
    assert 0 < spread < 3  # they mix, and are not one

    code, output = run("eval", folder.path, "--flights", "4", "--json", cwd=tmp_path)
    assert code == 0, output
    kept = json.loads(folder.evaluation.read_text())
    assert kept["measure"] == "return"
    assert len(kept["cells"]) == len(MEMBERS)
    greedy = [cells[0]["mean"] for cells in kept["cells"].values()]
    assert np.mean(greedy) > 100  # of 500; a beginner holds the pole for some 20 steps

    code, output = run("export", folder.path, "--format", "onnx", cwd=tmp_path)
    assert code == 0, output
    seen = np.random.default_rng(0).normal(0, 0.1, (32, 4)).astype(np.float32)
    session = onnxruntime.InferenceSession(folder.path / "policy.onnx")
    (logits,) = session.run(["logits"], {"observations": seen})
    actions = Pilot.load(folder.path).actions(seen, greedy=True)
    np.testing.assert_array_equal(logits.argmax(1), actions)


def test_drones_learn_from_pictures(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    small = ["--set", "training.worlds=2", "--set", "training.segment=16"]
    code, output = run(
        "up", SWARMS / "drones-ppo.toml", "--run", folder.path, *short(2), *small, cwd=tmp_path
    )
    assert code == 0, output
    for agent in MEMBERS:
        reports = list(folder.reports(agent))
        assert reports[-1].steps == 2 * 2 * 16
        assert set(reports[-1].weights) <= set(MEMBERS) - {agent}
        assert len(reports[-1].weights) == 2
    assert folder.newest("drone0").theta.size == 1_280_025  # the critic stays at home
    scene = ["--scene", "indoor-pyramid", "--flights", "2"]
    code, output = run("eval", folder.path, *scene, "--agent", "drone1", cwd=tmp_path)
    assert code == 0, output
    text = folder.evaluation.read_bytes()
    evaluation = json.loads(text)
    assert evaluation["agent"] == "drone1"
    assert 0 < evaluation["cells"]["indoor-pyramid"][0]["mean"] < 1000
    assert Evaluation.__struct_fields__ == tuple(evaluation)
    assert load(folder.config).training.worlds == 2


def test_mistakes_are_one_line(tmp_path: Path) -> None:
    cases = [
        (["eval", "nothing"], 'no policy "nothing": expected a path or a name'),
        (["eval", "nothing.safetensors"], 'no file "nothing.safetensors"'),
        (["export", "nothing.safetensors", "--format", "onnx"], "nothing.safetensors"),
        (["reproduce", "drones", "--estimator", "sarsa"], '"sarsa": expected one of'),
        (["reproduce", "drones", "--beside", "no.json"], "no.json: No such file"),
        (["up", str(SWARMS / "cartpole.toml"), "--set", 'estimator={kind="exact"}'], "exact"),
        (["up", str(SWARMS / "gridworld-a.toml"), "--set", "training.worlds=3"], "[training]"),
    ]
    for arguments, words in cases:
        code, output = run(*arguments, cwd=tmp_path)
        assert code != 0
        assert words in output
        assert "Traceback" not in output
