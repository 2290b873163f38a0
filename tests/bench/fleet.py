"""32 agents of a tabular task as processes on this machine: speed, memory, missed rounds.

The agents are those of ``swarm up``, on a ring, over Zenoh.  Resident memory counts the pages of
libraries in every process that maps them; proportional memory shares them out and is what one more
agent costs.
"""

import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import msgspec
from rich.console import Console

from agent.runfolder import RunFolder
from deploy.reproduce.settings import grid_swarm
from tests.bench.exchange import machine

AGENTS, ROUNDS = 32, 300
REQUIRED_MB = 60.0
LIMIT = 500.0  # [s]
_KB = re.compile(r"^(Rss|Pss): +(\d+) kB", re.MULTILINE)


def memory_mb(run: Path) -> list[tuple[float, float]]:
    """(resident, proportional) memory of each agent that runs for a folder [MB]."""
    found = []
    for process in Path("/proc").iterdir():
        if not process.name.isdigit():
            continue
        try:
            words = (process / "cmdline").read_bytes().decode().split("\0")
            if "--supervised" in words and str(run) in words:
                sizes = dict(_KB.findall((process / "smaps_rollup").read_text()))
                found.append((int(sizes["Rss"]) * 1.024e-3, int(sizes["Pss"]) * 1.024e-3))
        except (OSError, KeyError):  # it has just ended
            continue
    return found


def main() -> None:
    """Print three lines."""
    console = Console(width=100, highlight=False)
    console.print(f"[bold]{AGENTS} agents[/] on {machine()}")
    config = grid_swarm("a", AGENTS, rounds=ROUNDS, checkpoint_every=ROUNDS)
    with tempfile.TemporaryDirectory() as folder:
        file, run = Path(folder) / "swarm.json", Path(folder) / "run"
        file.write_bytes(msgspec.json.encode(config))
        command = [sys.executable, "-m", "deploy.cli", "up", str(file), "--run", str(run)]
        process = subprocess.Popen([*command, "--no-record"], stdout=subprocess.DEVNULL)
        reports, end = RunFolder(run), time.monotonic() + LIMIT
        sizes: list[tuple[float, float]] = []
        try:
            while process.poll() is None and time.monotonic() < end:
                last = reports.metrics(config.members[-1])
                if last.exists() and last.read_bytes().count(b"\n") > ROUNDS // 2:
                    sizes = memory_mb(run) or sizes
                time.sleep(0.2)
        finally:
            process.terminate()
            process.wait(10.0)
        played = {member: list(reports.reports(member)) for member in config.members}
    begin = max(rounds[0].time for rounds in played.values())
    ended = min(rounds[-1].time for rounds in played.values())
    missed = sum(len(report.missing) for rounds in played.values() for report in rounds)
    done = sum(len(rounds) for rounds in played.values())
    console.print(
        f"{(ROUNDS - 1) / (ended - begin):.0f} rounds/s of all; {done} of {AGENTS * ROUNDS} rounds "
        f"played, {missed} messages missed (required: 0)"
    )
    if sizes:
        resident, proportional = (statistics.median(size[i] for size in sizes) for i in (0, 1))
        console.print(
            f"memory per agent: {proportional:.0f} MB proportional (required: {REQUIRED_MB:.0f}), "
            f"{resident:.0f} MB resident; torch is not imported"
        )


if __name__ == "__main__":
    main()
