"""MAVProxy, as its users have it from PyPI, flies our ArduPilot-flavoured vehicle."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from agent.vehicle import Vehicle
from sim.vehicle.flavours import ARDUPILOT
from sim.vehicle.server import Options
from tests.integration.vehicles import HOST, vehicle

pytestmark = pytest.mark.integration
SPEED = 3.0


class MAVProxy:
    """The real program; type into it, read what it prints."""

    def __init__(self, master: str, folder: Path) -> None:
        self.lines: list[str] = []
        self._process = subprocess.Popen(
            [sys.executable, "-u", "-m", "MAVProxy.mavproxy", "--master", master,
             "--state-basedir", str(folder), "--aircraft", "test"],
            cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True, env=os.environ | {"MAVLINK20": "1"},
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.lines.append(line.rstrip())

    def type(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(text + "\n")
        self._process.stdin.flush()

    def said(self, words: str) -> bool:
        return any(words in line for line in list(self.lines))

    def close(self) -> None:
        self._process.kill()
        self._process.wait(10)
        self._reader.join(10)


@pytest.fixture
def flight(tmp_path: Path) -> Iterator[tuple[MAVProxy, Vehicle]]:
    """MAVProxy on the vehicle's main port, and a witness beside it."""
    with vehicle(Options(flavour=ARDUPILOT, speed=SPEED)) as options:
        proxy = MAVProxy(f"udpin:{HOST}:{options.port}", tmp_path)
        try:
            with Vehicle(f"udpout:{HOST}:{options.local_port}") as witness:
                yield proxy, witness
        finally:
            proxy.close()


def test_everything_that_issue_6_lists(flight: tuple[MAVProxy, Vehicle]) -> None:
    proxy, witness = flight

    def until(condition: Callable[[], bool], what: str, retype: str = "") -> None:
        end, pause, typed = time.monotonic() + 40.0, threading.Event(), time.monotonic()
        while not condition():
            if retype and time.monotonic() - typed > 1.0:
                proxy.type(retype)
                typed = time.monotonic()
            assert time.monotonic() < end, f"{what}: {proxy.lines[-12:]}, {witness.state}"
            pause.wait(0.05)

    until(lambda: proxy.said("Received 17 parameters"), "parameters: list")
    proxy.type("param set WPNAV_SPEED 400")
    proxy.type("param show WPNAV_SPEED")
    until(lambda: proxy.said("WPNAV_SPEED      400.0"), "parameters", "param show WPNAV_SPEED")
    witness.wait_ready()
    proxy.type("mode GUIDED")
    until(lambda: proxy.said("Mode GUIDED"), "modes")
    proxy.type("arm throttle")
    until(lambda: proxy.said("ARMED") and witness.state.armed, "arm")
    proxy.type("takeoff 4")
    until(lambda: witness.state.position[2] < -3.6, "take-off")
    proxy.type("velocity 1 0 0")
    until(lambda: witness.state.velocity[0] > 0.9, "guided: velocity")
    until(lambda: abs(witness.state.velocity[0]) < 0.05, "guided: stops without set points")
    east = witness.state.position[1] + 2.0
    proxy.type("position 0 2 0")
    until(lambda: abs(witness.state.position[1] - east) < 0.3, "guided: position")
    proxy.type("setyaw 90 20 0")
    until(lambda: abs(witness.state.attitude[2] - 1.571) < 0.1, "guided: yaw")
    proxy.type("mode RTL")
    until(lambda: proxy.said("Mode RTL"), "modes: RTL")
    proxy.type("mode LAND")
    until(lambda: not witness.state.armed, "land")
    until(lambda: proxy.said("DISARMED"), "disarm after landing")
