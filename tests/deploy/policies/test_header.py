"""A policy's file says where it comes from, what it wants and gives, and how far it flies."""

import os
from pathlib import Path

import msgspec
import onnx
import pytest

from agent.config.experiment import load
from agent.errors import CheckpointError
from agent.learning.pilot import Form, Pilot
from agent.learning.policies import Network
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder
from deploy.library import POLICIES, SWARMS, entries, find
from deploy.policies.evaluation import Cell, Evaluation
from deploy.policies.export import export
from deploy.policies.header import header_of, notes
from deploy.reproduce.drones.policies import header, name_of
from deploy.reproduce.drones.record import read
from swarm.errors import ConfigError
from swarm.reports.telemetry import RoundReport

RESULTS = Path(__file__).parents[3] / "deploy" / "docs" / "results" / "drones.json"
FORM = Form(Network((64, 64)), (4,), "float32", 2, critic=True)
CELLS = {"drone0": [Cell("greedy", 5, 480.0, 2.0, 0.0), Cell("stochastic", 5, 300.0, 9.0, 0.0)]}


def test_the_librarys_policies_say_what_was_measured_of_them() -> None:
    records = read(RESULTS)
    assert {path.stem for path in entries(POLICIES)} == {name_of(name) for name in records}
    for estimator, record in records.items():
        path = find(Path(name_of(estimator)), POLICIES)
        found = header_of(path)
        assert found is not None
        expected = header(estimator, record, Pilot.load(path).form)
        # What wrote it may be an older release than this one.
        assert found == msgspec.structs.replace(expected, software=found.software)
        assert found.licence == "Apache-2.0"
        assert "turn" in found.actions
        assert len(found.flights) == 6


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    """A run of two cart-poles that has come to its second round."""
    config = load(find(Path("cartpole"), SWARMS), ["rounds=2"])
    config = msgspec.structs.replace(config, agents=config.agents[:2])
    folder = RunFolder(tmp_path / "run")
    folder.write_config(config)
    theta = FORM.network().theta.numpy().copy()
    for agent in config.members:
        folder.prepare(agent)
        report = RoundReport(
            agent=agent, round=1, time=0.0, seconds=0.5, waited=0.1, value=1.0, episodes=3,
            steps=1_000, gradient_norm=1.0, disagreement=0.0, weights={},
        )  # fmt: skip
        folder.metrics(agent).write_bytes(msgspec.json.encode(report) + b"\n")
        kept = checkpoint.Checkpoint(round=2, fingerprint="", theta=theta)
        checkpoint.write(folder.checkpoints(agent), kept)
    return folder


def evaluated(folder: RunFolder, agent: str | None = None) -> None:
    found = Evaluation("run", agent, "return", 0, CELLS)
    folder.evaluation.write_bytes(msgspec.json.encode(found))


def test_an_exported_run_says_where_it_comes_from(run: RunFolder) -> None:
    evaluated(run)
    path = export(run.path, None, "safetensors", run.path / "p.safetensors", "CC-BY-4.0")
    found = header_of(path)
    assert found is not None
    assert (found.swarm, found.estimator, found.agent) == ("cartpole", "ppo", None)
    assert (found.seed, found.rounds, found.steps) == (1, 2, 2_000)
    assert len({task.env for task in found.worlds}) == 1
    assert len(found.worlds) == 2
    assert found.observations == "(4) float32"
    assert found.actions.startswith("0 to 1: as ")
    assert (found.licence, found.measure, found.flights) == ("CC-BY-4.0", "return", CELLS)
    assert found.software.startswith("dcpg-swarm ")
    text = "\n".join(found.lines())
    assert "drone0: greedy 480.0 ± 2.0 reward (of 5), stochastic 300.0" in text
    assert "flies 480 greedy and 300 stochastic" in found.title()
    # A file that is exported again, as ONNX say, keeps it.
    again = export(path, None, "onnx", run.path / "p.onnx")
    (kept,) = onnx.load(again).metadata_props
    assert {kept.key: kept.value} == notes(found)


def test_flights_of_other_parameters_are_not_claimed(run: RunFolder) -> None:
    evaluated(run, "drone0")
    path = run.path / "p.safetensors"
    found = header_of(export(run.path, None, "safetensors", path))
    assert found is not None
    assert found.flights == {}
    evaluated(run)
    os.utime(run.evaluation, (0.0, 0.0))  # and then it learned on
    found = header_of(export(run.path, None, "safetensors", path))
    assert found is not None
    assert found.flights == {}
    assert found.licence == ""
    assert "licence       not stated" in found.lines()
    run.evaluation.write_text("{}")
    with pytest.raises(ConfigError, match=r"eval\.json.*swarm eval"):
        export(run.path, None, "safetensors", path)


def test_a_file_without_a_header_is_fine_and_a_torn_one_is_named(tmp_path: Path) -> None:
    path = tmp_path / "p.safetensors"
    pilot = Pilot(FORM, FORM.network().theta.numpy().copy())
    pilot.save(path)
    assert header_of(path) is None
    pilot.save(path, {"header": "{}"})
    with pytest.raises(CheckpointError, match=r"p\.safetensors"):
        header_of(path)
    with pytest.raises(CheckpointError, match="no file"):
        header_of(tmp_path / "absent.safetensors")
