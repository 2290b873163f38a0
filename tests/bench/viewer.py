"""What an hour of four drones costs who watches: memory, and the size of a recording.

Replays what a session gets in that hour (a report of each agent every half second, four flight
samples a second with pictures of its world, all rounds counted) as fast as it is taken, into each
kind of output: a viewer without a window, which holds and draws what one with a window does, the
server behind browsers, and a file.  Required: under 2 GB.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import msgspec
import numpy as np
from rich.console import Console
from rich.table import Table

from agent.config.experiment import SwarmFile, load
from agent.daemon.pictures import png_of_depth, png_of_rgb
from deploy.flying.pilots import Greedy
from deploy.viewer import Output
from deploy.viewer.moments import Moment
from deploy.viewer.outputs import opened
from deploy.viewer.session import TICK
from swarm.reports.telemetry import FLIGHT_RATE, FlightSample, RoundReport

SWARM = Path(__file__).parents[2] / "deploy" / "library" / "swarms" / "drones-ppo.toml"
HOUR, MINUTE = 3600, 60  # [s]
STEPS = 5  # of a drone, between two samples
LONGEST = 400  # steps of a flight
REQUIRED = 2000  # MB, of all processes together
KINDS = ("viewer", "browsers", "file")


class Hour(msgspec.Struct):
    """What a replay cost: seconds it took, most memory of us and of the viewer [MB], file [MB]."""

    seconds: float
    ours: float
    viewer: float
    file: float = 0.0


def flown(config: SwarmFile) -> list[FlightSample]:
    """A minute's samples of every drone, greedily flown, with what their cameras saw."""
    scenes = [agent.task.kwargs["scene"] for agent in config.agents]
    worlds: Any = gymnasium.make_vec(
        "sim:IndoorFlight-v0", num_envs=len(scenes), scene=scenes, max_steps=LONGEST,
        vectorization_mode="vector_entry_point",
    ).unwrapped  # fmt: skip
    pilot = Greedy(len(scenes))
    worlds.reset(seed=0)
    fresh, flights = np.ones(len(scenes), np.bool_), np.zeros(len(scenes), int)
    tracks: list[list[tuple[float, float, float]]] = [[] for _ in scenes]
    samples = []
    for step in range(int(MINUTE * FLIGHT_RATE) * STEPS):
        actions = pilot.act(worlds.depth, worlds.pose, fresh)
        observations, rewards, ended, cut, _ = worlds.step(actions)
        fresh = ended | cut
        flights += fresh
        for i, agent in enumerate(config.members):
            x, y, z, _, _, yaw = worlds.pose[i]
            tracks[i] = [] if fresh[i] else [*tracks[i], (float(x), float(y), float(z))]
            if step % STEPS == STEPS - 1:
                samples.append(
                    FlightSample(
                        agent=agent, round=0, time=step / STEPS / FLIGHT_RATE,
                        flight=int(flights[i]), step=step, position=(float(x), float(y), float(z)),
                        yaw=float(yaw), action=int(actions[i]), reward=float(rewards[i]),
                        distance=0.0, track=tuple(tracks[i]), camera=png_of_rgb(observations[i]),
                        depth=png_of_depth(worlds.depth[i]),
                    )
                )  # fmt: skip
                tracks[i] = []
    worlds.close()
    return samples


def report(config: SwarmFile, agent: str, round_: int, at: float) -> RoundReport:
    """One of an agent that learns."""
    place = config.index(agent)
    around = (config.members[place - 1], config.members[(place + 1) % len(config.members)])
    sketch = np.random.default_rng([place, round_]).normal(size=32) / (1 + round_)
    return RoundReport(
        agent=agent, round=round_, time=at, seconds=TICK, waited=0.0, value=place + 1e-3 * round_,
        episodes=round_, steps=256 * round_, gradient_norm=1.0, disagreement=1 / (1 + round_),
        weights=dict.fromkeys(around, 1 / 3), sketch=tuple(sketch.tolist()), distance=0.01 * round_,
    )  # fmt: skip


def ticks(config: SwarmFile) -> Iterator[tuple[Moment, list[FlightSample]]]:
    """What arrives in an hour, half a second at a time."""
    minute, begun = flown(config), 1.7e9
    flights, most = max(s.flight for s in minute) + 1, int(MINUTE / TICK)
    for tick in range(int(HOUR / TICK)):
        at, (again, within) = begun + tick * TICK, divmod(tick, most)
        arrived = [
            msgspec.structs.replace(
                sample, time=begun + again * MINUTE + sample.time, round=tick,
                flight=again * flights + sample.flight,
            )
            for sample in minute
            if within * TICK <= sample.time < (within + 1) * TICK
        ]  # fmt: skip
        yield Moment.of(report(config, agent, tick, at) for agent in config.members), arrived


def memory(pid: int) -> float:
    """Resident memory [MB] of a process and all that it has started."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [(task / "children").read_text(encoding="ascii").split() for task in tasks]
    except OSError:
        return 0.0
    own = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
    return own + sum(memory(int(child)) for listed in children for child in listed)


def replay(kind: str, folder: Path) -> Hour:
    """Send an hour to an output of this kind."""
    file = folder / "hour.rrd"
    output = {
        "viewer": Output(headless=True, screenshot=folder / "hour.png"),
        "browsers": Output(web=True, ports=(19_090, 19_876)),
        "file": Output(save=file),
    }[kind]
    config = load(SWARM)
    hour, begun, mine = Hour(0.0, 0.0, 0.0), time.monotonic(), os.getpid()
    with opened(config, output) as recorder:
        for tick, (moment, samples) in enumerate(ticks(config)):
            recorder.take([moment], samples)
            if tick % int(10 / TICK) == 0:
                all_, pages = memory(mine), Path("/proc/self/statm").read_text(encoding="ascii")
                ours = int(pages.split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
                hour.ours, hour.viewer = max(hour.ours, ours), max(hour.viewer, all_ - ours)
            if tick % int(5 * MINUTE / TICK) == 0:
                now = f"{ours:.0f} + {all_ - ours:.0f} MB after {time.monotonic() - begun:.0f} s"
                print(f"{kind}: minute {tick * TICK / MINUTE:.0f}: {now}", file=sys.stderr)
    hour.seconds = time.monotonic() - begun
    hour.file = file.stat().st_size / 1e6 if file.exists() else 0.0
    return hour


def main() -> None:
    """Print the table; each output in a process of its own."""
    table = Table(title=f"an hour of four drones, replayed (required: under {REQUIRED:,} MB)")
    for column in ("output", "session [MB]", "viewer [MB]", "file [MB]", "took [s]"):
        table.add_column(column, justify="left" if column == "output" else "right")
    for kind in KINDS:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "tests.bench.viewer", kind, folder]
            hour = msgspec.json.decode(
                subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout.splitlines()[-1],
                type=Hour,
            )
        cells = (hour.ours, hour.viewer, hour.file, hour.seconds)
        table.add_row(kind, *(f"{cell:,.0f}" if cell else "" for cell in cells))
    Console(width=100).print(table)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(msgspec.json.encode(replay(sys.argv[1], Path(sys.argv[2]))).decode())
    else:
        main()
