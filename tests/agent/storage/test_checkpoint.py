"""Checkpoints: whole or not there, of the right layout, and never of a round yet to be played."""

from pathlib import Path

import numpy as np
import pytest

from agent.config.experiment import load
from agent.errors import CheckpointError
from agent.storage import checkpoint
from agent.storage.checkpoint import KEPT, Checkpoint
from agent.storage.runfolder import RunFolder
from tests.agent.config.test_experiment import FILE


def some(round_: int) -> Checkpoint:
    rng = np.random.default_rng(round_)
    return Checkpoint(
        round=round_,
        fingerprint="f" * 16,
        theta=rng.normal(size=8).astype(np.float32),
        mixing={"psi": rng.normal(size=8).astype(np.float32)},
        optimizer={"count": np.ones(1, np.float32)},
        episodes=10 * round_,
        steps=77,
    )


def test_read_gives_back_what_was_written(tmp_path: Path) -> None:
    written = some(3)
    read = checkpoint.read(checkpoint.write(tmp_path, written), "f" * 16)
    assert (read.round, read.episodes, read.steps) == (3, 30, 77)
    np.testing.assert_array_equal(read.theta, written.theta)
    np.testing.assert_array_equal(read.mixing["psi"], written.mixing["psi"])
    assert read.theta.dtype == np.float32
    assert set(read.optimizer) == {"count"}


def test_only_the_newest_stay_and_no_draft(tmp_path: Path) -> None:
    for round_ in range(KEPT + 5):
        checkpoint.write(tmp_path, some(round_))
    assert checkpoint.rounds_in(tmp_path) == list(range(5, KEPT + 5))
    assert not list(tmp_path.glob("*.draft"))


def test_later_rounds_are_dropped_before_they_are_played_again(tmp_path: Path) -> None:
    for round_ in range(4):
        checkpoint.write(tmp_path, some(round_))
    checkpoint.drop_after(tmp_path, 1)
    assert checkpoint.rounds_in(tmp_path) == [0, 1]


@pytest.mark.parametrize("damage", ["missing", "torn", "foreign", "layout"])
def test_what_cannot_be_used_is_refused_by_name(tmp_path: Path, damage: str) -> None:
    path = checkpoint.write(tmp_path, some(1))
    if damage == "missing":
        path.unlink()
    elif damage == "torn":
        path.write_bytes(path.read_bytes()[:100])
    elif damage == "foreign":
        path.write_bytes(b"not a checkpoint at all")
    with pytest.raises(CheckpointError, match=path.name):
        checkpoint.read(path, "0" * 16 if damage == "layout" else "f" * 16)


def test_a_swarm_resumes_at_the_newest_round_that_all_have(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    folder.write_config(load(FILE))
    for agent, rounds in {"a": [3, 4, 5], "b": [4, 5, 6], "c": [2, 3, 4]}.items():
        folder.prepare(agent)
        for round_ in rounds:
            checkpoint.write(folder.checkpoints(agent), some(round_))
    assert folder.common_round(("a", "b", "c")) == 4
    with pytest.raises(CheckpointError, match="newest: a 5, d none"):
        folder.common_round(("a", "d"))
