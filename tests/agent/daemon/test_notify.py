"""What systemd hears, over a socket of our own in its place."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from agent.daemon.notify import Systemd


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.settimeout(5.0)
        yield listener


@pytest.mark.parametrize("abstract", [False, True])
def test_it_hears_ready_alive_and_stopping(
    listener: socket.socket, tmp_path: Path, abstract: bool
) -> None:
    path = str(tmp_path / "notify")
    listener.bind("\0" + path if abstract else path)
    systemd = Systemd({"NOTIFY_SOCKET": "@" + path if abstract else path})
    systemd.ready()
    systemd.alive("round 3 of 9")
    systemd.stopping()
    heard = [listener.recv(1000).decode() for _ in range(3)]
    assert heard == ["READY=1", "WATCHDOG=1\nSTATUS=round 3 of 9", "STOPPING=1"]


def test_without_systemd_nothing_happens(tmp_path: Path) -> None:
    Systemd({}).ready()
    Systemd({"NOTIFY_SOCKET": str(tmp_path / "nobody")}).ready()
