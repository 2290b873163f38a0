"""How far hand-made pilots fly: ``swarm fly --pilot greedy|straight|random``.

MSF (mean safe flight) is the mean horizontal distance from start to crash; every one of the
parallel worlds flies the same number of flights, because counting the first that end would favour
short ones.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.table import Table

from deploy.flying.pilots import make_pilot
from sim.indoor.content.scenes import NAMES

MAX_STEPS = 2500  # 1 km; the cap of an evaluation
PARALLEL = 16  # flights at a time


@dataclass(frozen=True)
class Result:
    """How far one pilot flew in one world."""

    scene: str
    pilot: str
    flights: int
    msf: float  # m
    deviation: float  # m, standard
    median: float  # m
    longest: float  # m
    capped: float  # share of the flights that reached MAX_STEPS


def measure(scene: str, pilot: str, flights: int, seed: int) -> Result:
    """Fly, and measure the distances; the same seed gives the same numbers."""
    count = min(PARALLEL, flights)
    hand = make_pilot(pilot, seed, count)
    quota = np.full(count, flights // count) + (np.arange(count) < flights % count)
    envs: Any = gymnasium.make_vec(
        "sim:IndoorFlight-v0",
        num_envs=count,
        scene=scene,
        max_steps=MAX_STEPS,
        vectorization_mode="vector_entry_point",
    )
    distances: list[float] = []
    capped = 0
    envs.reset(seed=seed)
    fresh = np.ones(count, np.bool_)
    while quota.any():
        _, _, crashed, late, infos = envs.step(hand.act(envs.depth, envs.pose, fresh))
        fresh = crashed | late
        for i in np.flatnonzero(fresh & (quota > 0)):
            distances.append(float(infos["final_info"]["distance"][i]))
            capped += bool(late[i])
            quota[i] -= 1
    envs.close()
    flown = np.array(distances)
    return Result(
        scene=scene,
        pilot=pilot,
        flights=flights,
        msf=float(flown.mean()),
        deviation=float(flown.std()),
        median=float(np.median(flown)),
        longest=float(flown.max()),
        capped=capped / flights,
    )


def fly(
    pilot: str = "greedy",
    scenes: Sequence[str] = NAMES,
    flights: int = 16,
    seed: int = 0,
    *,
    as_json: bool = False,
) -> list[Result]:
    """Measure a pilot in some worlds and print a table, or JSON.

    The greedy one flies 1 km a flight, in about 2 s of CPU time each.
    """
    results = [measure(scene, pilot, flights, seed) for scene in scenes]
    if as_json:
        print(json.dumps([asdict(result) for result in results], indent=2))
        return results
    table = Table(title=f"{pilot} pilot, {flights} flights a world, seed {seed}")
    table.add_column("world")
    for column in ("MSF [m]", "± [m]", "median [m]", "longest [m]", "reached 1 km"):
        table.add_column(column, justify="right")
    for r in results:
        table.add_row(
            r.scene, f"{r.msf:.1f}", f"{r.deviation:.1f}", f"{r.median:.1f}", f"{r.longest:.1f}",
            f"{r.capped:.0%}",
        )  # fmt: skip
    Console().print(table)
    return results
