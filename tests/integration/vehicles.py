"""Simulated vehicles for tests: on free ports, in a thread, ended with the block."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from deploy.process.ports import Ports, hold_free
from sim.vehicle.autopilot import Autopilot
from sim.vehicle.server import Options, run

HOST = "127.0.0.1"


_HELD: list[Ports] = []  # until the tests end


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """A port that nobody else uses, or chooses, while the tests run."""
    _HELD.append(hold_free(HOST, 1, kind))
    return _HELD[-1].numbers[0]


@contextmanager
def vehicle(options: Options | None = None) -> Iterator[Options]:
    """A vehicle that flies until the block ends; its options with the ports filled in."""
    options = options or Options()
    kind = socket.SOCK_STREAM if options.tcp else socket.SOCK_DGRAM
    local = None if options.tcp else free_port()
    options = replace(options, port=free_port(kind), local_port=local, ground_port=None)
    stop, ready = threading.Event(), threading.Event()
    ended: list[Autopilot] = []

    def fly() -> None:
        ended.append(run(options, stop, ready=lambda port: ready.set()))

    thread = threading.Thread(target=fly, daemon=True)
    thread.start()
    try:
        assert ready.wait(90), "the vehicle did not start"
        yield options
    finally:
        stop.set()
        thread.join(10)
    assert ended, "the vehicle ended with an error"
