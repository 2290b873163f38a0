"""systemd accepts the agent's unit, finds little exposed, and hears from a real agent."""

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.integration.harness import ROOT, free_base_port, swarm

UNIT = ROOT / "deploy" / "images" / "agent@.service"
PROGRAM = "/opt/dcpg-swarm/bin/swarm"
EXPOSURE = 25  # tenths of systemd's scale from 0 to 10; up to 3.9 it says "OK"


@pytest.fixture
def unit(tmp_path: Path) -> Path:
    """The unit for drone0 with a program that is installed here."""
    if shutil.which("systemd-analyze") is None:
        reason = "systemd-analyze is not installed (Debian: systemd)"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    text = UNIT.read_text()
    assert f"ExecStart={PROGRAM} agent" in text
    copy = tmp_path / "agent@drone0.service"
    copy.write_text(text.replace(PROGRAM, sys.executable))
    return copy


def analyze(*arguments: str | Path) -> tuple[int, str]:
    """Exit code and everything that systemd-analyze says."""
    command = ["systemd-analyze", "--no-pager", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stdout + done.stderr


def test_systemd_accepts_the_unit(unit: Path) -> None:
    code, said = analyze("verify", unit)
    assert (code, [line for line in said.splitlines() if unit.name in line]) == (0, [])


def test_little_is_exposed(unit: Path) -> None:
    code, said = analyze("security", "--offline=true", f"--threshold={EXPOSURE}", unit)
    assert code == 0, said


@pytest.mark.integration
def test_an_agent_tells_systemd_that_it_is_ready_alive_and_stopping(tmp_path: Path) -> None:
    file = tmp_path / "one.toml"
    file.write_text(
        'name = "one"\nrounds = 1000000\ncheckpoint_every = 1000\n'
        f"[estimator]\nkind = 'exact'\n[network]\nbase_port = {free_base_port(1)}\n"
        "[[agents]]\nid = 'drone0'\n"
        "task = { env = 'sim:GridWorld-v0', kwargs = { layout = 'a', task = 0 } }\n"
    )
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(path)
        systemd.settimeout(60.0)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("NOTIFY_SOCKET", path)
            agent = swarm("agent", file, "--id", "drone0", "--run", tmp_path / "run", cwd=tmp_path)
            with agent as command:
                assert systemd.recv(1000) == b"READY=1"
                assert systemd.recv(1000).startswith(b"WATCHDOG=1\nSTATUS=round 1 of 1000000")
                command.process.terminate()
                while (said := systemd.recv(1000)) != b"STOPPING=1":
                    assert said.startswith(b"WATCHDOG=1")
                assert command.wait() == 0
