"""How fast parameters travel: our exchange, gloo, MPI, raw TCP and hivemind, in one run.

Four processes on one machine, a ring, every one sends its vector to both neighbours and has theirs
at the end: :mod:`tests.bench.exchange_peers`.  All peers are started first and then take turns, a
burst each, again and again, in a new order every time and after a pause in which the one before may
come to rest, so that a busy machine disturbs all alike; medians over the turns.
CPU time is of all four processes (not of the processes that hivemind starts) and hardly depends on
who else is busy.

Needs ``pip install -r requirements-bench.lock``; a peer that is not installed says so.
"""

import os
import platform
import random
import signal
import socket
import statistics
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from deploy.process.ports import hold_free
from tests.bench.exchange_peers import C3F2, LIMIT, RANKS, SMALL

TURNS = 9
BURST = {str(C3F2): 12, str(SMALL): 150, "compute": 1, "hidden": 1}  # steps
PAUSE = 0.2  # [s] before a burst
SLOW = "hivemind"  # a step takes part of a second: one a turn
PEERS = {
    "ours": "ours, shared memory",
    "ours-tcp": "ours, TCP",
    "gloo": "torch.distributed gloo",
    "tcp": "raw TCP sockets",
    "mpi": "MPI (mpi4py, mpich)",
    SLOW: "hivemind averager (exact mean)",
}
REQUIRED = (  # what is measured, whose, against whose, at most
    (C3F2, "ours", "gloo", 0.75),
    (C3F2, "ours", "tcp", 0.85),
    (C3F2, "ours", "mpi", 4.0),
    (C3F2, "ours-tcp", "gloo", 1.6),
    (SMALL, "ours", "gloo", 1.0),
)
HIDDEN = 1.03
START = 60.0  # [s]
Times = dict[str, list[tuple[float, float]]]  # peer -> wall and CPU [s] a step, by turn


@dataclass
class Group:
    """Four processes of one peer and the wires to them."""

    processes: list[subprocess.Popen[bytes]]
    orders: list[Any] = field(default_factory=list)
    answers: list[Any] = field(default_factory=list)

    def burst(self, what: str, steps: int) -> tuple[float, float]:
        """Seconds a step of the slowest process, and CPU-seconds a step of all four."""
        for order in self.orders:
            print(what, steps, file=order, flush=True)
        took = [tuple(map(float, answer.readline().split())) for answer in self.answers]
        return max(wall for wall, _ in took) / steps, sum(cpu for _, cpu in took) / steps

    def close(self) -> None:
        """End the processes."""
        for wire in (*self.orders, *self.answers):
            wire.close()
        for process in self.processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(5.0)
            with suppress(ProcessLookupError):  # and what it has started itself
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def start(name: str) -> Group | None:
    """The four processes of a peer, ready; None where they do not start."""
    with hold_free("127.0.0.1", 10) as held:  # peers of other makers could not listen beside us
        base = str(held.numbers[0])
    command = [sys.executable, "-m", "tests.bench.exchange_peers", name]
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(START)
        tail = [base, str(server.getsockname()[1])]
        if name == "mpi":
            mpiexec = Path(sys.executable).with_name("mpiexec")
            commands = [[str(mpiexec), "-n", str(RANKS), *command, "0", *tail]]
        else:
            commands = [[*command, str(rank), *tail] for rank in range(RANKS)]
        try:
            group = Group([_process(command) for command in commands])
        except FileNotFoundError:
            return None
        for _ in range(RANKS):
            link = _accept(server, group)
            if link is None:
                group.close()
                return None
            group.answers.append(link.makefile("r"))
            group.orders.append(link.makefile("w"))
            group.answers[-1].readline()
    return group


def _process(command: list[str]) -> subprocess.Popen[bytes]:
    quiet = None if "BENCH_DEBUG" in os.environ else subprocess.DEVNULL
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=quiet, start_new_session=True)


def _accept(server: socket.socket, group: Group) -> socket.socket | None:
    """The next process that is ready; None when one has ended instead, or none is in time."""
    waits = int(START)
    server.settimeout(1.0)
    for _ in range(waits):
        try:
            link, _ = server.accept()
        except TimeoutError:
            if any(process.poll() for process in group.processes):
                return None
            continue
        link.settimeout(LIMIT)
        return link
    return None


def take_turns(groups: dict[str, Group], kinds: dict[str, str]) -> Times:
    """Times of every kind of burst, in turns; hivemind is left out when it stops answering.

    Args:
        groups: the peers' processes.
        kinds: label -> order, of the group of that label (or of ``ours``).
    """
    times: Times = {label: [] for label in kinds}
    order = random.Random(0)
    for turn in range(TURNS + 1):
        for label, what in order.sample(list(kinds.items()), len(kinds)):
            if label not in times:
                continue
            time.sleep(PAUSE)
            steps = 1 if label == SLOW else BURST[what]
            try:
                took = groups.get(label, groups["ours"]).burst(what, steps)
            except TimeoutError:
                told = f"{PEERS.get(label, label)}: no answer to {what} within {LIMIT:.0f} s"
                if label != SLOW:  # whose processes now and then wait for each other for ever
                    sys.exit(told)
                print(told)
                del times[label], groups[label]
                continue
            if turn:  # the first warms up
                times[label].append(took)
    return times


def median(times: Times, label: str, which: int = 0) -> float:
    """Wall (0) or CPU (1) seconds a step."""
    return statistics.median(took[which] for took in times[label])


def machine() -> str:
    """What the figures were measured on."""
    info = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    names = [line.split(":")[1].strip() for line in info.splitlines() if "model name" in line]
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    return (
        f"{os.cpu_count()} x {names[0] if names else platform.machine()}, "
        f"load {load} when it began, Python {platform.python_version()}"
    )


def print_peers(console: Console, groups: dict[str, Group]) -> None:
    """Both sizes, all peers, and the required ratios."""
    found: dict[int, Times] = {}
    for size, name in ((C3F2, "5.12 MB (C3F2)"), (SMALL, "10 KB")):
        times = found[size] = take_turns(groups, dict.fromkeys(groups, str(size)))
        table = Table(title=f"ring exchange of {name}, {RANKS} processes, median of {TURNS} turns")
        for column in ("", "ms", "of gloo", "of raw TCP", "CPU-ms, all"):
            table.add_column(column, justify="right" if column else "left")
        for peer, label in PEERS.items():
            if peer not in times:
                why = "pip install -r requirements-bench.lock, or no answer"
                table.add_row(label, why, "", "", "")
                continue
            wall = median(times, peer)
            ratios = [f"{wall / median(times, to):.2f}" for to in ("gloo", "tcp") if to in times]
            cpu = "" if peer == SLOW else f"{median(times, peer, 1) * 1e3:.2f}"
            table.add_row(label, f"{wall * 1e3:.2f}", *ratios, cpu)
        console.print(table)
    for size, ours, other, limit in REQUIRED:
        if other in found[size]:
            by = [
                median(found[size], ours, which) / median(found[size], other, which)
                for which in (0, 1)
            ]
            console.print(
                f"{'5.12 MB' if size == C3F2 else '10 KB'}: {PEERS[ours]}, of {PEERS[other]}: "
                f"{by[0]:.2f} (required: {limit:g}), in CPU time {by[1]:.2f}"
            )


def print_hidden(console: Console, groups: dict[str, Group]) -> None:
    """What the exchange of the large vector adds to a round that computes."""
    times = take_turns(groups, {"compute": "compute", "hidden": "hidden"})
    pairs = zip(times["hidden"], times["compute"], strict=True)
    wall = statistics.median(with_[0] / without[0] for with_, without in pairs)
    cpu = median(times, "hidden", 1) / median(times, "compute", 1)
    console.print(
        f"round of {median(times, 'compute') * 1e3:.0f} ms computation with the exchange of "
        f"5.12 MB underneath: {wall:.3f} of the time without (required: {HIDDEN}), "
        f"{cpu:.3f} of the CPU time"
    )


def main() -> None:
    """Print the tables."""
    console = Console(width=100, highlight=False)
    console.print(f"[bold]Exchange of parameters[/] on {machine()}")
    with ExitStack() as resources:
        groups = {}
        for peer in PEERS:
            if (group := start(peer)) is not None:
                groups[peer] = group
                resources.callback(group.close)
        print_peers(console, groups)
        print_hidden(console, groups)


if __name__ == "__main__":
    main()
