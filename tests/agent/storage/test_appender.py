"""Files that grow: records are whole or not there, and a full disk holds nobody up."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from agent.storage.appender import REMIND, RETRY, Appender
from agent.storage.metrics import open_metrics
from tests.agent.storage.test_shelf import Clock
from tests.deploy.viewer.test_viewer import report


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 kB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], check=True)
    try:
        yield disk
    finally:
        subprocess.run(["umount", "--lazy", disk], check=True)


def test_a_full_disk_tears_no_record_and_loses_none_when_there_is_room_again(
    small_disk: Path,
) -> None:
    told: list[str] = []
    clock = Clock()
    (small_disk / "ballast").write_bytes(bytes(32_000))
    path = small_disk / "metrics.jsonl"
    lines = [f"{i:04d} {'x' * 994}\n".encode() for i in range(50)]
    with Appender(path, warn=told.append, clock=clock) as kept:
        for line in lines:
            kept.write(line)
        held = path.read_bytes()
        assert 0 < len(held) < 50_000
        assert held == b"".join(lines)[: len(held)]
        assert len(held) % 1000 == 0  # the last record that fitted is whole
        assert len(told) == 1
        assert "No space left on device" in told[0]
        clock.now += REMIND
        kept.write(b"late\n")
        assert len(told) == 2
        (small_disk / "ballast").unlink()
        clock.now += RETRY
        kept.write(b"later\n")
        assert path.read_bytes() == b"".join([*lines, b"late\n", b"later\n"])
        assert told[-1].endswith("is written again")


def test_a_torn_last_line_does_not_spoil_the_next(tmp_path: Path) -> None:
    path = tmp_path / "lines"
    path.write_bytes(b"whole\nto")
    with Appender(path, lines=True) as kept:
        kept.write(b"next\n")
    assert path.read_bytes() == b"whole\nto\nnext\n"


def test_metrics_keep_what_does_not_read_and_drop_what_is_played_again(tmp_path: Path) -> None:
    path = tmp_path / "drone0.jsonl"
    lines = [msgspec.json.encode(report(0, k)) + b"\n" for k in range(4)]
    path.write_bytes(lines[0] + b"from another version\n" + lines[1] + lines[2] + b'{"agent": "dr')
    with open_metrics(path, 2) as kept:
        kept.write(lines[2])
    assert path.read_bytes() == (
        lines[0] + b"from another version\n" + lines[1] + b'{"agent": "dr\n' + lines[2]
    )
