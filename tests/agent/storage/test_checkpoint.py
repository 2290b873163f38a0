"""Checkpoints: whole or not there, of the right layout, and never of a round yet to be played."""

from pathlib import Path

import numpy as np
import pytest

from agent.config.experiment import load
from agent.errors import CheckpointError
from agent.storage import checkpoint
from agent.storage.checkpoint import Checkpoint
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


def test_a_bit_that_has_changed_is_noticed(tmp_path: Path) -> None:
    path = checkpoint.write(tmp_path, some(1))
    whole = bytearray(path.read_bytes())
    whole[-1] ^= 1
    path.write_bytes(whole)
    with pytest.raises(CheckpointError, match="its checksum differs"):
        checkpoint.read(path)


def test_what_does_not_read_is_passed_over_with_a_line(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for round_ in (1, 2, 3):
        checkpoint.write(tmp_path, some(round_))
    checkpoint.path_of(tmp_path, 3).write_bytes(b"")
    found = checkpoint.newest(tmp_path)
    assert found is not None
    assert found.round == 2
    (line,) = caplog.messages
    assert "00000003.safetensors" in line
    assert line.endswith("passing over it")


def held(tmp_path: Path, rounds: dict[str, list[int]]) -> RunFolder:
    folder = RunFolder(tmp_path)
    folder.write_config(load(FILE))
    for agent, kept in rounds.items():
        folder.prepare(agent)
        for round_ in kept:
            checkpoint.write(folder.checkpoints(agent), some(round_))
    return folder


def test_a_swarm_resumes_at_the_newest_round_that_all_have(tmp_path: Path) -> None:
    folder = held(tmp_path, {"a": [3, 4, 5], "b": [4, 5, 6], "c": [2, 3, 4]})
    assert folder.common_round(("a", "b", "c")) == 4
    assert folder.common_round(("a", "d")) is None  # d has nothing, and a's beginning is gone


def test_it_resumes_at_an_older_round_where_the_newest_is_torn(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = held(tmp_path, {"a": [3, 4, 5], "b": [3, 4, 5, 6]})
    checkpoint.path_of(folder.checkpoints("b"), 5).write_bytes(b"{")
    assert folder.common_round(("a", "b")) == 4
    assert len(caplog.messages) == 1


def test_whoever_has_lost_nothing_can_begin_anew(tmp_path: Path) -> None:
    folder = held(tmp_path, {"a": [1, 2], "b": [], "c": [10, 20]})
    assert folder.common_round(("a", "b")) == 0
    assert folder.common_round(("b",)) == 0
    assert folder.common_round(("b", "c")) is None
    assert folder.common_round(("b", "c"), every=10) == 0
