"""32 agents of a tabular task as processes on this machine: speed, memory, missed rounds.

The agents are those of ``swarm up``, on a ring, over Zenoh.
"""

import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import msgspec
from rich.console import Console

from agent.storage.runfolder import RunFolder
from deploy.launch.child import command
from deploy.reproduce.settings import grid_swarm
from tests.bench.exchange import machine
from tests.bench.processes import Holding, holdings

AGENTS, ROUNDS = 32, 300
REQUIRED_MB = 60.0
LIMIT = 500.0  # [s]


def main() -> None:
    """Print three lines."""
    console = Console(width=100, highlight=False)
    console.print(f"[bold]{AGENTS} agents[/] on {machine()}")
    config = grid_swarm("a", AGENTS, rounds=ROUNDS, checkpoint_every=ROUNDS)
    with tempfile.TemporaryDirectory() as folder:
        file, run = Path(folder) / "swarm.json", Path(folder) / "run"
        file.write_bytes(msgspec.json.encode(config))
        process = subprocess.Popen(command(file, run), stdout=subprocess.DEVNULL)
        reports, end = RunFolder(run), time.monotonic() + LIMIT
        held: dict[str, Holding] = {}
        try:
            while process.poll() is None and time.monotonic() < end:
                last = reports.metrics(config.members[-1])
                if last.exists() and last.read_bytes().count(b"\n") > ROUNDS // 2:
                    held = holdings(run) or held
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
    if held:
        resident = statistics.median(holding.resident for holding in held.values())
        proportional = statistics.median(holding.proportional for holding in held.values())
        console.print(
            f"memory per agent: {proportional:.0f} MB proportional (required: {REQUIRED_MB:.0f}), "
            f"{resident:.0f} MB resident; torch is not imported"
        )


if __name__ == "__main__":
    main()
