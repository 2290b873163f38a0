"""Vehicles as processes: the command line, and lockstep."""

import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from agent.vehicle import Timing, Vehicle
from sim.vehicle.flavours import ARDUPILOT, PX4, Flavour
from sim.vehicle.fleet import from_json, start, to_json
from sim.vehicle.lockstep import LockstepClient, VehicleLostError
from sim.vehicle.quadrotor import NOISY, Weather
from sim.vehicle.server import Options
from tests.integration.vehicles import HOST, free_port
from tests.notices import without_notices

pytestmark = pytest.mark.integration
ROOT = Path(__file__).parents[2]


def command(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "deploy.cli", "vehicle", *arguments],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def test_two_vehicles_and_a_taken_port() -> None:
    ports = free_port(), free_port()
    running = [
        command("--port", str(port), "--sysid", str(sysid), "--flavour", flavour,
                "--speed", "4", "--ground-port", "0", "--wind", "1,0,0.3", "--noise",
                *(("--scene", "indoor-long") if sysid == 7 else ()))
        for port, sysid, flavour in zip(ports, (7, 8), ("px4", "ardupilot"), strict=True)
    ]  # fmt: skip
    try:
        for process, sysid in zip(running, (7, 8), strict=True):
            assert process.stderr is not None
            greeting = next(line for line in process.stderr if without_notices(line))
            assert f"vehicle {sysid} (" in greeting
        taken = command("--port", str(ports[0]))
        _, words = taken.communicate(timeout=170)
        assert taken.returncode == 3
        pattern = r"swarm: vehicle 1 cannot listen on port \d+: .* in use\n"
        assert re.fullmatch(pattern, without_notices(words))
        with (
            Vehicle(f"udpin:{HOST}:{ports[0]}", Timing(command=20.0)) as first,
            Vehicle(f"udpin:{HOST}:{ports[1]}", Timing(command=20.0)) as second,
        ):
            assert (first.system, second.system) == (7, 8)
            first.take_off(1.5)
            assert second.state.landed is not False
    finally:
        for process in running:
            process.send_signal(signal.SIGINT)
    assert [process.wait(10) for process in running] == [0, 0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--flavour", "betaflight"], "expected one of px4, ardupilot"),
        (["--sysid", "0"], "system id 0: expected 1 to 250"),
        (["--wind", "strong"], "expected NORTH,EAST"),
        (["--signing-key", "/nowhere"], "cannot be read"),
        (["--scene", "indoor-nowhere"], "indoor-nowhere"),
        (["--scene", "indoor-long", "--start", "99"], "start 99 of indoor-long: expected 0 to"),
    ],
)
def test_a_mistake_is_one_line(arguments: list[str], words: str) -> None:
    process = command(*arguments)
    _, said = process.communicate(timeout=170)
    assert process.returncode == 2
    assert words in said
    assert without_notices(said).count("\n") == 1


@pytest.mark.parametrize("flavour", [PX4, ARDUPILOT], ids=lambda flavour: flavour.name)
def test_lockstep_is_exact(flavour: Flavour) -> None:
    process, client = start(Options(flavour=flavour, lockstep=0.4))
    try:
        first = client.connect()
        placed = client.place(1.0, 2.0, -2.0, 0.5)
        assert placed.position == (1.0, 2.0, -2.0)
        state = client.fly_to(1.0, 2.0, -2.0, 0.5)
        assert state.time_boot_ms == first.time_boot_ms + 400
        assert state.position == pytest.approx((1.0, 2.0, -2.0), abs=0.01)
        assert state.attitude[2] == pytest.approx(0.5, abs=0.01)
        for _ in range(20):
            state = client.fly_at(0.5, 0.0, 0.0, 0.5)
        assert state.time_boot_ms == first.time_boot_ms + 400 * 21
        assert state.velocity[0] == pytest.approx(0.5, abs=0.02)
        assert client.wait().time_boot_ms == state.time_boot_ms + 400
    finally:
        client.close()
        process.close()


def test_lockstep_flights_repeat_to_the_bit() -> None:
    def flight() -> list[tuple[float, ...]]:
        process, client = start(Options(lockstep=0.4, seed=4))
        try:
            client.place(0.0, 0.0, -2.0, 0.0)
            return [client.fly_to(k * 0.4, 0.1 * k, -2.0, 0.1 * k).position for k in range(20)]
        finally:
            client.close()
            process.close()

    assert flight() == flight()


def test_lost_datagrams_are_healed_and_a_dead_vehicle_is_noticed() -> None:
    """Every third set point is lost, then every third answer; time still counts every step once."""
    process, client = start(Options(lockstep=0.4), timing=None)
    try:
        state = client.place(0.0, 0.0, -2.0, 0.0)
        lossy = _Lossy(client._socket)
        client._timing = type(client._timing)(answer=0.05, give_up=5.0)
        client._socket = lossy  # type: ignore[assignment]
        for k in range(30):
            after = client.fly_to(0.0, 0.0, -2.0, 0.0)
            assert after.time_boot_ms == state.time_boot_ms + 400 * (k + 1)
        assert lossy.lost > 10
        process.close()
        client._timing = type(client._timing)(answer=0.05, give_up=30.0)
        with pytest.raises(VehicleLostError, match="the process of vehicle 1 has ended"):
            client.wait()
    finally:
        client.close()
        process.close()


class _Lossy:
    """A socket that loses every third datagram, both ways."""

    def __init__(self, inner: socket.socket) -> None:
        self._inner = inner
        self._count = self.lost = 0

    def _loses(self) -> bool:
        self._count += 1
        self.lost += self._count % 3 == 0
        return self._count % 3 == 0

    def sendto(self, data: bytes, peer: tuple[str, int]) -> None:
        if not self._loses():
            self._inner.sendto(data, peer)

    def recvfrom(self, size: int) -> tuple[bytes, tuple[str, int]]:
        while True:
            data, peer = self._inner.recvfrom(size)
            if not self._loses():
                return data, peer

    def settimeout(self, seconds: float) -> None:
        self._inner.settimeout(seconds)

    def close(self) -> None:
        self._inner.close()


def test_options_travel_to_the_process_unchanged() -> None:
    options = Options(
        flavour=ARDUPILOT, key=bytes(range(32)), lockstep=0.4, scene="indoor-long", seed=7,
        weather=Weather((1.0, 2.0, 0.0), 0.5), noise=NOISY,
    )  # fmt: skip
    assert from_json(to_json([options, Options()])) == [options, Options()]


def test_nobody_there() -> None:
    from sim.vehicle.lockstep import Timing as Patience

    with (
        LockstepClient(timing=Patience(appear=0.2)) as client,
        pytest.raises(VehicleLostError, match="does not answer"),
    ):
        client.connect()
