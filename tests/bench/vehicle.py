"""What the MAVLink vehicle costs: lockstep steps per CPU-second, real time in CPU share.

A step of the environment is 0.4 simulated seconds: set point out, 100 substeps of 4 ms, telemetry
back over UDP, collision, rendering, reward.  CPU-seconds are those of both processes.
"""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.table import Table

from agent.vehicle import Vehicle
from sim.vehicle.flavours import FLAVOURS
from sim.vehicle.fleet import start
from sim.vehicle.server import Options
from tests.integration.vehicles import HOST, free_port

ROOT = Path(__file__).parents[2]
REQUIRED = 250  # environment steps per second and core
STEPS = 1200
REAL_TIME = 10.0  # s of wall clock


def cpu_of(pid: int) -> float:
    """CPU seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def bare_steps(flavour: str) -> float:
    """Lockstep steps a CPU-second, without an environment."""
    process, client = start(Options(flavour=FLAVOURS[flavour], lockstep=0.4))
    try:
        client.place(0.0, 0.0, -2.0, 0.0)
        client.fly_at(0.5, 0.0, 0.0, 0.5)
        begun = time.process_time() + cpu_of(process.pid)
        for _ in range(STEPS):
            client.fly_at(0.5, 0.0, 0.0, 0.5)
        return STEPS / (time.process_time() + cpu_of(process.pid) - begun)
    finally:
        client.close()
        process.close()


def env_steps(count: int, body: str, flavour: str | None = None) -> tuple[float, float]:
    """Steps of `count` flights in indoor-long: a CPU-second, a second."""
    options: dict[str, Any] = {"body_options": {"flavour": flavour}} if flavour else {}
    envs: Any = gymnasium.make_vec(
        "sim:IndoorFlight-v0", num_envs=count, scene="indoor-long", body=body,
        vectorization_mode="vector_entry_point", **options,
    )  # fmt: skip
    bodies = envs.unwrapped._bodies
    pid = bodies[0]._process.pid if bodies else None

    def cpu() -> float:
        return time.process_time() + (cpu_of(pid) if pid else 0.0)

    actions = np.random.default_rng(0).choice([11, 12, 12, 12, 13], size=(STEPS // count, count))
    envs.reset(seed=0)
    envs.step(actions[0])
    used, begun = cpu(), time.perf_counter()
    for action in actions:
        envs.step(action)
    used, begun = cpu() - used, time.perf_counter() - begun
    envs.close()
    return actions.size / used, actions.size / begun


def real_time(flavour: str, scene: str | None) -> float:
    """Share of a core that a vehicle needs while it hovers on set points."""
    port = free_port()
    command = [sys.executable, "-m", "deploy.cli", "vehicle", "--port", str(port),
               "--flavour", flavour, "--ground-port", "0"]  # fmt: skip
    with subprocess.Popen(
        [*command, *(["--scene", scene] if scene else [])], cwd=ROOT, stderr=subprocess.DEVNULL
    ) as process:
        try:
            with Vehicle(f"udpin:{HOST}:{port}") as drone:
                drone.take_off(1.5)
                before, begun = cpu_of(process.pid), time.monotonic()
                while time.monotonic() - begun < REAL_TIME:
                    drone.fly_at(0.0, 0.0, 0.0, 0.0)
                    time.sleep(0.1)
                return (cpu_of(process.pid) - before) / (time.monotonic() - begun)
        finally:
            process.terminate()


def main() -> None:
    """Print the tables."""
    console = Console(width=100)
    lockstep = Table(title=f"lockstep, 0.4 s a step (required: {REQUIRED} env steps)")
    for column in ("", "flavour", "steps/CPU-s", "steps/s"):
        lockstep.add_column(column, justify="left" if column in {"", "flavour"} else "right")
    for flavour in FLAVOURS:
        lockstep.add_row("vehicle alone", flavour, f"{bare_steps(flavour):,.0f}", "")
    for flavour in FLAVOURS:
        for count in (1, 4, 16):
            used, wall = env_steps(count, "mavlink", flavour)
            name = f"environment, {count} flights" if count > 1 else "environment, one flight"
            lockstep.add_row(name, flavour, f"{used:,.0f}", f"{wall:,.0f}")
    used, wall = env_steps(16, "kinematic")
    lockstep.add_row("environment, 16 flights", "kinematic", f"{used:,.0f}", f"{wall:,.0f}")
    console.print(lockstep)

    table = Table(title="real time, hovering on set points at 20 Hz")
    for column in ("flavour", "world", "share of a core"):
        table.add_column(column, justify="right" if column.startswith("share") else "left")
    for flavour in FLAVOURS:
        for scene in (None, "indoor-long"):
            share = real_time(flavour, scene)
            table.add_row(flavour, scene or "open field", f"{share:.1%}")
    console.print(table)


if __name__ == "__main__":
    main()
