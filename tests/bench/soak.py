"""Four agents for 20,000 rounds: what they hold of the machine must not grow.

::

    python -m tests.bench.soak [ROUNDS]

Grid world (a) by ``swarm up`` as everybody starts it.  Prints what the largest agent holds after
every tenth of the rounds; exit code 1 if memory or handles grow after the first tenth.  Minutes, so
``make bench`` leaves it out.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

from agent.storage.runfolder import RunFolder
from deploy.launch.child import command
from deploy.process.logs import LOG_BYTES, LOG_FILES
from tests.bench.exchange import machine
from tests.bench.processes import Holding, holdings

FILE = Path("deploy/library/swarms/gridworld-a.toml")
ROUNDS, POINTS = 20_000, 10
MORE_MB, MORE_HANDLES = 3.0, 0  # growth from the first point to the last that counts as none
LIMIT = 3600.0  # [s]
LOOK_EVERY = 0.2  # [s]


def main(rounds: int = ROUNDS) -> int:
    """Print a table; exit code."""
    console = Console(width=100, highlight=False)
    console.print(f"[bold]four agents, {rounds} rounds[/] on {machine()}")
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        order = command(FILE, run, "--set", f"rounds={rounds}")
        process = subprocess.Popen(order, stdout=subprocess.DEVNULL)
        start = time.monotonic()
        try:
            seen = watch(run, rounds, process)
        finally:
            process.terminate()
            process.wait(10.0)
        files = sorted((run / "logs").iterdir())
        logs = sum(file.stat().st_size for file in files)
    table = Table()
    for heading in ("round", "resident [MB]", "proportional [MB]", "handles", "threads"):
        table.add_column(heading, justify="right")
    for round_, held in seen.items():
        largest = (f"{held.resident:.1f}", f"{held.proportional:.1f}")
        table.add_row(f"{round_}", *largest, f"{held.handles}", f"{held.threads}")
    console.print(table)
    first, *_, last = seen.values()
    more, handles = last.resident - first.resident, last.handles - first.handles
    good = more <= MORE_MB and handles <= MORE_HANDLES and process.returncode == 0
    console.print(
        f"{'flat' if good else 'GROWS'}: {more:+.1f} MB resident, {handles:+d} handles; logs "
        f"{logs / 1e3:.1f} kB in {len(files)} files (rotated at {LOG_BYTES / 1e6:.0f} MB, "
        f"{LOG_FILES} old ones stay); {time.monotonic() - start:.0f} s, exit code "
        f"{process.returncode}"
    )
    return 0 if good else 1


def watch(run: Path, rounds: int, process: subprocess.Popen[bytes]) -> dict[int, Holding]:
    """The most that any agent holds after every tenth of the rounds; waits for the run's end."""
    seen: dict[int, Holding] = {}
    points = [rounds * i // POINTS for i in range(1, POINTS)]
    metrics, read, played = RunFolder(run).metrics("drone0"), 0, 0
    end = time.monotonic() + LIMIT
    while process.poll() is None and time.monotonic() < end:
        time.sleep(LOOK_EVERY)
        if not metrics.exists():
            continue
        with metrics.open("rb") as file:
            file.seek(read)
            news = file.read()
        read, played = read + len(news), played + news.count(b"\n")
        if points and played >= points[0]:
            held = holdings(run).values()
            points = [point for point in points if point > played]
            seen[played] = Holding(
                resident=max(holding.resident for holding in held),
                proportional=max(holding.proportional for holding in held),
                handles=max(holding.handles for holding in held),
                threads=max(holding.threads for holding in held),
            )
    return seen


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
