"""Links within one process: what is handed over arrives, and nobody holds up anybody else."""

import subprocess
import sys
import threading
import time

from swarm.wire.links import Links
from swarm.wire.stream import Arrival
from swarm.wire.transport import MemoryTransport


class Keeper:
    """Takes everything."""

    def __init__(self) -> None:
        self.arrived: list[Arrival] = []
        self.notes: list[tuple[str, bytes]] = []
        self.news = threading.Condition()

    def admits(self, sender: str) -> bool:
        return True

    def check(self, sender: str, life: str, kind: str, header: bytes, length: int) -> None: ...

    def refuse(self, sender: str, error: Exception) -> None:
        raise error

    def receive(self, arrival: Arrival) -> None:
        with self.news:
            self.arrived.append(arrival)
            self.news.notify_all()

    def note(self, sender: str, life: str, kind: str, header: bytes) -> None:
        with self.news:
            self.notes.append((kind, header))
            self.news.notify_all()

    def progress(self, sender: str) -> None: ...

    def wait(self, count: int) -> None:
        with self.news:
            assert self.news.wait_for(lambda: len(self.arrived) + len(self.notes) >= count, 30.0)


def test_what_is_handed_over_arrives_and_an_absent_neighbour_holds_up_nobody() -> None:
    network: dict[str, MemoryTransport] = {}
    here, there = Keeper(), Keeper()
    with (
        Links(MemoryTransport(network, "a"), "a", "1", here, shared_memory=False) as a,
        Links(MemoryTransport(network, "b"), "b", "1", there, shared_memory=False) as b,
    ):
        body = bytes(range(256)) * 20_000
        a.send("nobody", "round", b"h", body)
        a.send("b", "round", b"h", body)
        there.wait(1)
        assert (there.arrived[0].header, bytes(there.arrived[0].body)) == (b"h", body)
        a.drain()
        a.note("b", "beat", b"n")
        there.wait(2)
        assert there.notes == [("beat", b"n")]
        b.send("a", "round", b"back", body)
        here.wait(1)
        report = a.report()
        assert report["nobody"].backlog == len(body)
        assert report["b"].resent == 0
        assert a.moved("b") <= time.monotonic()


def test_importing_the_network_changes_nothing_in_the_process() -> None:
    code = "import os; a = dict(os.environ); import swarm.exchange, swarm.wire.session; "
    code += "assert dict(os.environ) == a"
    subprocess.run([sys.executable, "-c", code], check=True)
