"""Lockstep vehicles in a process of their own: ``python -m sim.vehicle.fleet``.

Interface: :func:`start_all`, :func:`start`.  The process belongs to the group of the one that
started it, reads its vehicles from standard input as JSON, flies each in a thread, and ends when
its standard input does: so it never outlives its parent, however that ends.
"""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from sim.vehicle import server
from sim.vehicle.flavours import FLAVOURS
from sim.vehicle.lockstep import LockstepClient, Timing
from sim.vehicle.rooms import Room

ROOT = Path(__file__).parents[2]
PATIENCE = 5.0  # s for the process to end by itself


class VehicleProcess:
    """The process; it has as many users as vehicles, and ends with the last ``release``."""

    def __init__(self, options: Sequence[server.Options]) -> None:
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        self._users = len(options)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "sim.vehicle.fleet"],
            env=os.environ | {"PYTHONPATH": path},
            stdin=subprocess.PIPE,
        )
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended already: see ``alive``
            self._process.stdin.write(to_json(options) + b"\n")
            self._process.stdin.flush()

    @property
    def pid(self) -> int:
        return self._process.pid

    def alive(self) -> bool:
        """Whether it still runs."""
        return self._process.poll() is None

    def release(self) -> None:
        """One user less."""
        self._users -= 1
        if self._users <= 0:
            self.close()

    def close(self) -> None:
        """End it; by force if it does not listen."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def start_all(
    options: Sequence[server.Options], timing: Timing | None = None
) -> tuple[VehicleProcess, list[LockstepClient]]:
    """Start vehicles on free ports in one process, and clients that are connected; close them.

    Raises:
        VehicleLostError: they are not heard.
    """
    clients = [LockstepClient(0, each.system, each.key, timing) for each in options]
    vehicles = VehicleProcess(
        [
            replace(each, port=client.port, local_port=0, ground_port=None)
            for each, client in zip(options, clients, strict=True)
        ]
    )
    try:
        for client in clients:
            client.alive = vehicles.alive
            client.connect()
    except BaseException:
        for client in clients:
            client.close()
        vehicles.close()
        raise
    return vehicles, clients


def start(
    options: server.Options, timing: Timing | None = None
) -> tuple[VehicleProcess, LockstepClient]:
    """The same for one vehicle."""
    vehicles, clients = start_all([options], timing)
    return vehicles, clients[0]


def to_json(options: Sequence[server.Options]) -> bytes:
    """Vehicles as JSON; a flavour is its name."""
    tables = [msgspec.to_builtins(each) | {"flavour": each.flavour.name} for each in options]
    return msgspec.json.encode(tables)


def from_json(text: bytes) -> list[server.Options]:
    """The inverse of :func:`to_json`."""
    options = []
    for table in msgspec.json.decode(text):
        flavour = FLAVOURS[table.pop("flavour")]
        options.append(replace(msgspec.convert(table, server.Options), flavour=flavour))
    return options


def main() -> None:
    """Fly the vehicles of the first line until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one that started us
    options = from_json(sys.stdin.buffer.readline())
    rooms = {(o.scene, o.start): Room(o.scene, o.start) for o in options if o.scene is not None}
    stop = threading.Event()
    threads = []
    for each in options:
        room = None if each.scene is None else rooms[each.scene, each.start]
        kwargs = {"options": each, "stop": stop, "room": room}
        threads.append(threading.Thread(target=server.run, kwargs=kwargs))
    for thread in threads:
        thread.start()
    sys.stdin.buffer.read()  # nothing ever comes; the end of it is our end
    stop.set()
    for thread in threads:
        thread.join()


if __name__ == "__main__":
    main()
