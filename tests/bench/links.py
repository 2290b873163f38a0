"""What a round costs over links of some rate and latency: ``python -m tests.bench.links``.

Every agent is a process, every link a proxy process (:mod:`deploy.chaos.shaping`) between two of
them; all exchange C3F2 (5.12 MB) with their neighbours, each direction of each link at the full
rate.  The physical time of a round is bytes / rate + two latencies.  Required: every round mixes
with every neighbour, in at most :data:`FACTOR` times that (:data:`FACTOR_RESETS` in the mean where
one connection in a hundred is reset in a round), beside what the same round costs through proxies
that do not shape, which is the machine's own time.
"""

import argparse
import multiprocessing as mp
import statistics
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from deploy.chaos.shaping import Shape, shaped
from deploy.process.ports import hold_free
from swarm.exchange import Exchange
from swarm.mixing.compression import Plain
from swarm.protocol.machine import Machine
from swarm.protocol.quorum import Quorum
from swarm.protocol.timing import Timing
from swarm.wire.buffers import bytes_of, new_vector
from swarm.wire.keys import Keys
from swarm.wire.links import LinkReport
from swarm.wire.payload import Layout
from swarm.wire.roster import Roster
from swarm.wire.security import Party
from swarm.wire.session import Network, open_session

C3F2 = 1_280_025  # [float32]
RATES = (2.0, 5.0, 20.0, 50.0, 100.0, 1000.0)  # [Mbit/s]
LATENCIES = (1.0, 20.0, 150.0)  # [ms]
FACTOR, FACTOR_RESETS = 1.25, 1.5
RESETS = (100.0, 20.0, 100)  # rate [Mbit/s], latency [ms] and rounds of the row with resets
CHANCE = 0.01  # of a reset, a round and connection
START = 60.0  # [s]
_spawn = mp.get_context("spawn")


@dataclass(frozen=True, slots=True)
class Measured:
    """One case.

    Attributes:
        first: the round in which the window grows [s].
        rounds: the others [s].
        mixed: uses of an edge that there should be, and that there were.
        publish: longest time that handing over took [s].
        reports: of every link.
    """

    first: float
    rounds: tuple[float, ...]
    mixed: tuple[int, int]
    publish: float
    reports: tuple[LinkReport, ...]


def neighbours_of(rank: int, agents: int) -> tuple[int, ...]:
    """In a ring, which for two is a line."""
    return tuple(sorted({(rank - 1) % agents, (rank + 1) % agents}))


def agent(rank: int, agents: int, size: int, ports: list[int], pipe: Connection) -> None:
    """Play as many rounds as the pipe says, and tell of each."""
    names = tuple(f"drone{i}" for i in range(agents))
    nearby = tuple(names[i] for i in neighbours_of(rank, agents))
    keys, stop = Keys("links"), threading.Event()
    network = Network(shared_memory=False, gossip=False)
    dialled = [f"tcp/127.0.0.1:{ports[agents + rank * agents + i]}"
               for i in neighbours_of(rank, agents) if i < rank]  # fmt: skip
    layout = Layout("links", (("theta", (size,)),))
    with ExitStack() as stack:
        session = stack.enter_context(
            open_session(
                network, Party(names[rank], keys, names), [f"tcp/127.0.0.1:{ports[rank]}"], dialled
            )
        )
        roster = stack.enter_context(Roster(session, keys, names))
        machine = Machine(
            names[rank], "1", names, lambda _here: nearby, layout.fingerprint, 10**9,
            Timing(), Quorum(minimum=0), "bench",
        )  # fmt: skip
        exchange = stack.enter_context(
            Exchange(session, keys, machine, layout, Plain(), roster, shared_memory=False)
        )
        for neighbour in nearby:
            exchange.links.reach(neighbour)
        roster.announce(names[rank], "1")
        roster.wait_for(nearby, START)
        end = time.monotonic() + START
        while any(link.rate is None for link in exchange.links.report().values()):
            assert time.monotonic() < end, exchange.links.report()
            time.sleep(0.01)
        exchange.start(0, True, stop)
        pipe.send("ready")
        for round_ in range(pipe.recv()):
            theta = new_vector(size, np.dtype(np.float32))
            theta[:] = 1.0
            begun = time.monotonic()
            exchange.publish(round_, bytes_of(theta), float(np.linalg.norm(theta)))
            handed = time.monotonic() - begun
            gathered = exchange.gather(stop)
            assert gathered is not None
            pipe.send((time.monotonic() - begun, handed, len(gathered.mix.used)))
        pipe.send([exchange.links.report()[n] for n in nearby])
        pipe.recv()


def link(listen: int, target: int, shape: Shape, pipe: Connection) -> None:
    """A proxy until the pipe says so; then how often it was reset."""
    with shaped(listen, target, shape) as shaper:
        pipe.send("ready")
        pipe.recv()
        pipe.send(shaper.resets)


@contextmanager
def process(target: Any, *arguments: Any) -> Iterator[Connection]:
    """A process and the pipe to it; ended at the end."""
    ours, theirs = _spawn.Pipe()
    child = _spawn.Process(target=target, args=(*arguments, theirs), daemon=True)
    child.start()
    try:
        yield ours
    finally:
        ours.send(None)
        child.join(10.0)
        child.kill()


def measure(agents: int, size: int, shape: Shape, rounds: int) -> Measured:
    """Play the rounds of one case."""
    with ExitStack() as stack:
        held = stack.enter_context(hold_free("127.0.0.1", agents + agents * agents))
        ports = list(held.numbers)
        for rank in range(agents):
            for other in neighbours_of(rank, agents):
                if other < rank:
                    listen = ports[agents + rank * agents + other]
                    proxy = stack.enter_context(process(link, listen, ports[other], shape))
                    proxy.recv()
        pipes = [
            stack.enter_context(process(agent, rank, agents, size, ports)) for rank in range(agents)
        ]
        for pipe in pipes:
            pipe.recv()
        for pipe in pipes:
            pipe.send(rounds)
        told = [[pipe.recv() for pipe in pipes] for _ in range(rounds)]
        reports = tuple(report for pipe in pipes for report in pipe.recv())
    took = [max(one[0] for one in round_) for round_ in told]
    used = sum(one[2] for round_ in told for one in round_)
    due = rounds * sum(len(neighbours_of(rank, agents)) for rank in range(agents))
    handed = max(one[1] for round_ in told for one in round_)
    return Measured(took[0], tuple(took[1:]), (due, used), handed, reports)


def physical(size: int, shape: Shape) -> float:
    """Time that a round takes at least [s]."""
    return 4 * size * 8 / shape.rate + 2 * shape.latency


def row(
    agents: int, size: int, shape: Shape, rounds: int, unshaped: float
) -> tuple[list[str], bool]:
    """A row of the table, and whether it is as required."""
    found, least = measure(agents, size, shape, rounds), physical(size, shape)
    of = statistics.mean if shape.resets else statistics.median
    usual, factor = of(found.rounds), FACTOR_RESETS if shape.resets else FACTOR
    due, used = found.mixed
    holds = used == due and usual <= factor * least + unshaped
    resumes, resent = (
        sum(getattr(r, what) for r in found.reports) for what in ("resumes", "resent")
    )
    cells = [
        "2 agents" if agents == 2 else f"ring of {agents}",
        f"{shape.rate / 1e6:g}", f"{shape.latency * 1e3:g}", f"{used}/{due}", f"{least:.3f}",
        f"{found.first:.3f}", f"{usual:.3f}", f"{usual / least:.2f}",
        f"{found.publish * 1e3:.1f}", f"{resumes}", f"{resent / 1e6:.2f}",
        "yes" if holds else "NO",
    ]  # fmt: skip
    return cells, holds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, nargs="*", default=[2, 4])
    parser.add_argument("--rate", type=float, nargs="*", default=RATES, help="[Mbit/s]")
    parser.add_argument("--latency", type=float, nargs="*", default=LATENCIES, help="[ms]")
    parser.add_argument("--rounds", type=int, default=0, help="0: as many as take a minute, 3 to 9")
    parser.add_argument("--size", type=int, default=C3F2, help="[float32]")
    parser.add_argument("--resets", action="store_true", help="only the row with resets")
    options = parser.parse_args()
    console = Console(width=120, highlight=False)
    table = Table(title=f"rounds of {4 * options.size / 1e6:.2f} MB each way")
    for column in (
        "", "Mbit/s", "ms one way", "mixed", "physical s", "first s", "round s", "of physical",
        "hand over ms", "resumes", "MB again", "as required",
    ):  # fmt: skip
        table.add_column(column, justify="right" if column else "left")
    right = True
    for agents in options.agents:
        free = measure(agents, options.size, Shape(0.0), 6)
        own = statistics.median(free.rounds)
        console.print(f"{agents} agents, proxies that do not shape: {own:.3f} s a round")
        cases = [(rate, latency) for rate in options.rate for latency in options.latency]
        shapes = [Shape(1e6 * rate, latency / 1e3) for rate, latency in cases]
        plan = [
            (shape, options.rounds or max(3, min(9, int(60 / physical(options.size, shape)))))
            for shape in shapes
        ]
        rate, latency, rounds = RESETS
        lossy = Shape(1e6 * rate, latency / 1e3)
        chance = CHANCE / physical(options.size, lossy)
        lossy = Shape(lossy.rate, lossy.latency, resets=chance)
        for shape, count in [*([] if options.resets else plan), (lossy, rounds)]:
            cells, holds = row(agents, options.size, shape, count, own)
            console.print(" ".join(cells))
            table.add_row(*cells)
            right &= holds
    console.print(table)
    sys.exit(0 if right else 1)


if __name__ == "__main__":
    main()
