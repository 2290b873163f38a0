"""The simulator against real processes: swarm files run both ways must agree bit for bit.

Every agent of the file is a process of its own and hears the others over Zenoh.  Between them the
files have exact and sampled gradients, a critic, losses, bytes on the wire and rules that remember.
"""

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from agent.config.experiment import SwarmFile, load
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder
from deploy.launch.child import swarm_up
from deploy.policies.scoring import Referee
from deploy.reproduce.claims import Claim, Findings, Options
from deploy.simulate.simulator import Vectors, simulate

SWARMS = Path(__file__).parents[1] / "library" / "swarms"
FILES = (
    "chain-exact",
    "gridworld-a",
    "gridworld-b-ppo-int8",
    "gridworld-d-start",
    "gridworld-a-16-extra-loss",
)
LIMIT = 480.0  # [s] for one swarm
# On a machine so busy that an agent stands still for seconds its neighbours would go on without it.
PATIENT = ["network.lease_ms=30000", "timing.round_floor=60", "timing.round=60"]


def study(options: Options) -> Findings:
    """See the module's docstring."""
    claims: list[Claim] = []
    data: dict[str, Any] = {}
    for k, name in enumerate(FILES):
        file = SWARMS / f"{name}.toml"
        settings = PATIENT + ["rounds=20"] * options.quick
        config = load(file, settings)
        size, rounds = len(config.agents), config.rounds
        options.say(f"{name}: {size} processes, {rounds} rounds", k / len(FILES))
        start = time.perf_counter()
        real = run_processes(file, settings, config)
        middle = time.perf_counter()
        simulated = simulate(config).thetas
        seconds = {"processes": middle - start, "simulator": time.perf_counter() - middle}
        same = real.dtype == simulated.dtype and np.array_equal(real, simulated)
        apart = float(np.abs(real - simulated).max())
        ours = "the same bits" if same else f"off by {apart:.1e}"
        times = f"{seconds['processes']:.1f} s, simulated {seconds['simulator']:.1f} s"
        what = f"{name}: {size} processes, {rounds} rounds"
        claims.append(Claim(what, "", "the same bits", f"{ours}; {times}", bool(same)))
        data[name] = seconds | {"same": same}
        if name.startswith("gridworld"):
            shares = Referee(config).judge(real, chances=False).share
            data[name] |= {"share_of_optimum": shares}
    return Findings(
        title="Simulator and real processes over Zenoh",
        claims=claims,
        notes=["Times are of whole runs, with the start of all processes."],
        data=data,
        figures=[],
    )


def run_processes(file: Path, settings: list[str], config: SwarmFile) -> Vectors:
    """Parameters (N, d) after `swarm up FILE`.

    Raises:
        SwarmError: it failed; the last line says why.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        options = (part for text in settings for part in ("--set", text))
        swarm_up(file, path, *options, limit=LIMIT)
        run = RunFolder(path)
        return np.stack(
            [
                checkpoint.read(checkpoint.path_of(run.checkpoints(agent), config.rounds)).theta
                for agent in config.members
            ]
        )
