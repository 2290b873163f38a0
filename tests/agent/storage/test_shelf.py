"""Which checkpoints stay, and which are brought to the disk."""

import errno
import os
from pathlib import Path

import pytest

from agent.storage import checkpoint, files
from agent.storage.checkpoint import KEPT
from agent.storage.shelf import DURABLE, SELDOM, Shelf
from tests.agent.storage.test_checkpoint import some


class Clock:
    """Tells the time that a test sets [s]."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was brought to the disk, in order."""
    order: list[str] = []

    def sync(path: Path) -> None:
        order.append(path.name)

    monkeypatch.setattr(files, "_sync", sync)
    return order


def test_the_newest_stay_and_what_is_on_the_disk(tmp_path: Path, synced: list[str]) -> None:
    clock = Clock()
    shelf = Shelf(tmp_path, clock)
    for round_ in range(1, 2000):
        clock.now += 0.005
        assert shelf.put(some(round_))
    held = checkpoint.rounds_in(tmp_path)
    assert held[-KEPT:] == list(range(2000 - KEPT, 2000))
    durable = held[:-KEPT]
    assert 2 <= len(durable) <= DURABLE
    files_synced = [name for name in synced if name.endswith(".safetensors")]
    assert set(durable) <= {int(name.split(".")[0]) for name in files_synced}
    assert len(synced) == 2 * len(files_synced)  # each file, and its folder after it
    seconds = 2000 * 0.005
    assert seconds / SELDOM <= len(files_synced) <= 10 + 2 * seconds
    assert not list(tmp_path.glob("*.draft*"))


def test_agents_of_one_swarm_bring_common_rounds_to_the_disk(
    tmp_path: Path, synced: list[str]
) -> None:
    folders = tmp_path / "a", tmp_path / "b"
    clock = Clock()
    for folder in folders:
        folder.mkdir()
    first, second = (Shelf(folder, clock) for folder in folders)
    for round_ in range(1, 1500):
        clock.now += 0.004
        first.put(some(round_))
        clock.now += 0.003
        second.put(some(round_))
    kept = [set(checkpoint.rounds_in(folder)[:-KEPT]) for folder in folders]
    assert kept[0] & kept[1]


def test_every_long_round_is_brought_to_the_disk(tmp_path: Path, synced: list[str]) -> None:
    clock = Clock()
    shelf = Shelf(tmp_path, clock)
    for round_ in range(1, 300):
        clock.now += 0.005
        shelf.put(some(round_))
    synced.clear()
    for round_ in range(300, 310):
        clock.now += SELDOM
        shelf.put(some(round_))
    assert len(synced) == 2 * 10


def test_a_file_is_on_the_disk_before_it_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []
    fsync, replace = os.fsync, Path.replace

    def note_fsync(handle: int) -> None:
        name = Path(f"/proc/self/fd/{handle}").readlink().name
        order.append(f"fsync {name}")
        fsync(handle)

    def note_replace(self: Path, target: Path) -> Path:
        order.append(f"rename {self.name} {target.name}")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", note_fsync)
    monkeypatch.setattr(Path, "replace", note_replace)
    files.write_file(tmp_path / "kept.json", b"{}")
    draft = "kept.draft.json"
    assert order == [f"fsync {draft}", f"rename {draft} kept.json", f"fsync {tmp_path.name}"]


def test_a_full_disk_costs_the_checkpoint_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    clock = Clock()
    shelf = Shelf(tmp_path, clock)
    assert shelf.put(some(1))
    whole = files.write_file

    def full(*arguments: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(checkpoint, "write_file", full)
    for round_ in range(2, 122):
        clock.now += 1.0
        assert not shelf.put(some(round_))
    assert len(caplog.messages) == 2  # once a minute
    assert "No space left on device" in caplog.messages[0]
    assert "checkpoint of round 2 " in caplog.messages[0]
    monkeypatch.setattr(checkpoint, "write_file", whole)
    assert shelf.put(some(122))
    assert caplog.messages[-1].endswith("is written again")
    assert checkpoint.rounds_in(tmp_path) == [1, 122]
