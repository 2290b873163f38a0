"""One process of a ring of four, for :mod:`tests.bench.exchange`: ours and those we compare with.

``python -m tests.bench.exchange_peers NAME RANK PORTS CONTROL`` connects to the control port, says
its rank, and then does as it is told: ``SIZE STEPS`` makes that many steps with vectors of so many
float32 and answers with the seconds and the CPU-seconds that they took.  A step: the own vector to
both neighbours, theirs from both, in memory of our own at the end (hivemind: the mean of all four,
its only step).  For ``SIZE`` the words ``compute`` and ``hidden`` stand for a round's computation
without and with our exchange of the large vector.
"""

import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarm.exchange import Exchange
from swarm.mixing.compression import Plain
from swarm.protocol.machine import Machine
from swarm.protocol.quorum import Quorum
from swarm.protocol.timing import Timing
from swarm.wire.buffers import sum_of
from swarm.wire.keys import Keys
from swarm.wire.payload import Layout
from swarm.wire.roster import Roster
from swarm.wire.security import Party
from swarm.wire.session import Network, open_session

Vector = NDArray[np.float32]
Step = Callable[[], None]
RANKS = 4
C3F2, SMALL = 1_280_025, 2_560  # [float32] the indoor policy, 5.12 MB; 10 KB
SIZES = (C3F2, SMALL)
WORK = 6_000_000  # turns of an empty loop
LIMIT = 120.0  # [s] of the longest burst


def neighbours_of(rank: int) -> tuple[int, int]:
    """Left and right in the ring."""
    return (rank - 1) % RANKS, (rank + 1) % RANKS


def vector_of(rank: int, size: int) -> Vector:
    """What this rank sends."""
    return np.random.default_rng(rank).standard_normal(size, dtype=np.float32)


# --- ours -----------------------------------------------------------------------------------


class Ours:
    """The agents' own exchange: header, guard, layout, finiteness, norm, deadline and all."""

    def __init__(self, rank: int, port: int, shared_memory: bool) -> None:
        self._rank = rank
        names = tuple(f"drone{i}" for i in range(RANKS))
        self._nearby = tuple(sorted(names[i] for i in neighbours_of(rank)))
        network = Network(shared_memory=shared_memory)
        endpoints = [f"tcp/127.0.0.1:{port + i}" for i in range(RANKS)]
        party = Party(names[rank], Keys("bench"), names)
        self._opened = open_session(network, party, endpoints[rank : rank + 1], endpoints[:rank])
        session = self._opened.__enter__()
        roster = Roster(session, party.keys, names)

        def exchange(size: int) -> Exchange:
            layout = Layout(swarm="bench", parts=(("theta", (size,)),))
            machine = Machine(
                names[rank], "1", names, lambda here: self._nearby, layout.fingerprint, 10**9,
                Timing(), Quorum(), "bench",
            )  # fmt: skip
            return Exchange(
                session, Keys(f"bench{size}"), machine, layout, Plain(), roster,
                shared_memory=shared_memory,
            )  # fmt: skip

        self._exchanges = {size: exchange(size) for size in SIZES}
        self._rounds = {size: count() for size in SIZES}
        roster.announce(names[rank], "1")
        roster.wait_for(names, LIMIT)
        end = time.monotonic() + LIMIT
        for opened in self._exchanges.values():  # their subscriptions may come after their tokens
            for neighbour in self._nearby:
                opened.links.reach(neighbour)
            while any(link.delivered == 0 for link in opened.links.report().values()):
                assert time.monotonic() < end, f"{self._nearby}: not all listen"
                time.sleep(0.01)
        for opened in self._exchanges.values():
            opened.start(0, True, threading.Event())

    def step(self, size: int) -> Step:
        return self._round(size, lambda: None)

    def hidden(self) -> Step:
        """The exchange of the large vector under a round's computation."""
        return self._round(C3F2, compute)

    def _round(self, size: int, work: Step) -> Step:
        exchange, codec = self._exchanges[size], Plain()
        mine = vector_of(self._rank, size)
        theta = sum_of(mine, np.zeros_like(mine))  # as a round's mixing leaves it
        norm, stop, rounds = float(np.linalg.norm(theta)), threading.Event(), self._rounds[size]

        def once() -> None:
            round_ = next(rounds)
            exchange.publish(round_, codec.encode(theta), norm)
            work()
            gathered = exchange.gather(stop)
            assert gathered is not None
            assert len(gathered.mix.used) == 2, gathered.mix.missing

        return once


def compute() -> None:
    """The computation of a short round: some 0.3 CPU-seconds in the interpreter."""
    total = 0
    for i in range(WORK):
        total += i & 7


# --- raw TCP --------------------------------------------------------------------------------


class RawTcp:
    """Two sockets, a sending thread for each, ``recv_into`` a buffer that is there already."""

    def __init__(self, rank: int, port: int) -> None:
        server = socket.create_server(("127.0.0.1", port + rank))
        right = _dial(port + neighbours_of(rank)[1])
        left, _ = server.accept()
        self._rank, self._links = rank, (left, right)
        for link in self._links:
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def step(self, size: int) -> Step:
        mine = vector_of(self._rank, size).data.cast("B")
        theirs = [memoryview(bytearray(len(mine))) for _ in self._links]

        def once() -> None:
            senders = [threading.Thread(target=s.sendall, args=(mine,)) for s in self._links]
            for sender in senders:
                sender.start()
            for link, buffer in zip(self._links, theirs, strict=True):
                got = 0
                while got < len(buffer):
                    got += link.recv_into(buffer[got:])
            for sender in senders:
                sender.join()

        return once


def _dial(port: int) -> socket.socket:
    """A connection to a neighbour that may still be starting."""
    end = time.monotonic() + LIMIT
    while True:
        try:
            return socket.create_connection(("127.0.0.1", port))
        except ConnectionRefusedError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)


# --- gloo, MPI, hivemind --------------------------------------------------------------------


class Gloo:
    """torch.distributed, ``isend`` and ``irecv`` with both neighbours."""

    def __init__(self, rank: int, port: int) -> None:
        from torch import distributed, set_num_threads

        set_num_threads(1)
        self._rank, where = rank, f"tcp://127.0.0.1:{port}"
        distributed.init_process_group("gloo", init_method=where, rank=rank, world_size=RANKS)

    def step(self, size: int) -> Step:
        import torch
        from torch import distributed

        mine = torch.from_numpy(vector_of(self._rank, size))
        theirs = {n: torch.empty_like(mine) for n in neighbours_of(self._rank)}

        def once() -> None:
            works = [distributed.irecv(buffer, n) for n, buffer in theirs.items()]
            works += [distributed.isend(mine, n) for n in theirs]
            for work in works:
                assert work is not None
                work.wait()

        return once


class Mpi:
    """mpi4py, ``Isend`` and ``Irecv`` with both neighbours."""

    def __init__(self) -> None:
        from mpi4py import MPI

        self._mpi, self._comm = MPI, MPI.COMM_WORLD
        self.rank = int(self._comm.Get_rank())

    def step(self, size: int) -> Step:
        mine = vector_of(self.rank, size)
        theirs = {n: np.empty_like(mine) for n in neighbours_of(self.rank)}
        comm = self._comm

        def once() -> None:
            requests = [comm.Irecv(buffer, n) for n, buffer in theirs.items()]
            requests += [comm.Isend(mine, n) for n in theirs]
            self._mpi.Request.Waitall(requests)

        return once


class Hivemind:
    """Its averager over a DHT of the four; a step forms a group and takes the exact mean."""

    def __init__(self, rank: int, port: int) -> None:
        import hivemind

        self._rank, self._hivemind = rank, hivemind
        place = f"/ip4/127.0.0.1/tcp/{port + rank}"
        if rank == 0:
            self._dht = hivemind.DHT(host_maddrs=[place], start=True)
            address = str(self._dht.get_visible_maddrs()[0])
            self._server = socket.create_server(("127.0.0.1", port + RANKS))
            for _ in range(RANKS - 1):
                link, _ = self._server.accept()
                with link:
                    link.sendall(address.encode())
        else:
            with _dial(port + RANKS) as link, link.makefile() as lines:
                address = lines.read()
            self._dht = hivemind.DHT(host_maddrs=[place], initial_peers=[address], start=True)

    def step(self, size: int) -> Step:
        import torch

        tensor = torch.from_numpy(vector_of(self._rank, size))
        averager = self._hivemind.DecentralizedAverager(
            [tensor], self._dht, prefix=f"bench{size}", target_group_size=RANKS,
            min_group_size=RANKS, min_matchmaking_time=1.0, request_timeout=0.5, start=True,
        )  # fmt: skip

        def once() -> None:
            assert averager.step(timeout=LIMIT) is not None

        return once


# --- the process ----------------------------------------------------------------------------


def build(name: str, rank: int, port: int) -> Any:
    """The peer called ``name``; raises ImportError where its package is missing."""
    match name:
        case "ours":
            return Ours(rank, port, shared_memory=True)
        case "ours-tcp":
            return Ours(rank, port, shared_memory=False)
        case "tcp":
            return RawTcp(rank, port)
        case "gloo":
            return Gloo(rank, port)
        case "mpi":
            return Mpi()
        case "hivemind":
            return Hivemind(rank, port)
    raise ValueError(name)


@contextmanager
def _orders(port: int) -> Iterator[tuple[Any, Any]]:
    with socket.create_connection(("127.0.0.1", port)) as link:
        yield link.makefile("r"), link.makefile("w")


def main(name: str, rank: int, port: int, control: int) -> None:
    """Do as the control port says until it closes."""
    peer = build(name, rank, port)
    steps: dict[str, Step] = {"compute": compute}
    with _orders(control) as (orders, answers):
        print(getattr(peer, "rank", rank), file=answers, flush=True)
        for order in orders:
            what, times = order.split()
            if what not in steps:
                steps[what] = peer.hidden() if what == "hidden" else peer.step(int(what))
            start, used = time.perf_counter(), time.process_time()
            for _ in range(int(times)):
                steps[what]()
            took = (time.perf_counter() - start, time.process_time() - used)
            print(*took, file=answers, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
