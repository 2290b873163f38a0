"""How far hand-made pilots fly: ``swarm fly --pilot greedy|straight|random``.

MSF (mean safe flight) is the mean horizontal distance from start to crash, over a
:class:`~deploy.flying.quota.Quota` of flights.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from deploy.flying.pilots import make_pilot
from deploy.flying.quota import Quota
from deploy.process.news import working
from sim.indoor.content.scene import check
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


def measure_in(
    scene: str,
    pilot: str,
    flights: int,
    seed: int,
    tell: Callable[[int, float], None] = lambda ended, share: None,
) -> Result:
    """Fly in one world, and measure the distances; the same seed gives the same numbers.

    After every step `tell` hears how many flights have ended, and the share of all that is flown.
    """
    count = min(PARALLEL, flights)
    hand = make_pilot(pilot, seed, count)
    quota, steps = Quota.split(flights, count, MAX_STEPS), np.zeros(count, np.int64)
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
    while quota.flying:
        _, _, crashed, late, infos = envs.step(hand.act(envs.depth, envs.pose, fresh))
        fresh = crashed | late
        steps = np.where(fresh, 0, steps + 1)
        for i in map(int, np.flatnonzero(fresh)):
            if quota.end(i):
                distances.append(float(infos["final_info"]["distance"][i]))
                capped += bool(late[i])
        tell(quota.ended, quota.share(steps.tolist()))
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


def measure_pilot(
    pilot: str = "greedy",
    scenes: Sequence[str] = NAMES,
    flights: int = 16,
    seed: int = 0,
    *,
    as_json: bool = False,
) -> list[Result]:
    """Measure a pilot in some worlds and print a table, or JSON.

    The greedy one flies 1 km a flight, in about 2 s of CPU time each.

    Raises:
        ValueError, OSError: there is no such pilot or world.
    """
    make_pilot(pilot, seed, 1)
    for scene in scenes:
        check(scene)
    results = []
    with working(f"flying the {pilot} pilot") as news:
        for k, scene in enumerate(scenes):

            def tell(ended: int, share: float, k: int = k, scene: str = scene) -> None:
                done = (k + share) / len(scenes)
                news.say(f"{scene}, {ended} of {flights} flights ended", done)

            news.say(scene, k / len(scenes))
            results.append(measure_in(scene, pilot, flights, seed, tell))
    if as_json:
        print(json.dumps([asdict(result) for result in results], indent=2))
        return results
    table = Table(title=f"{pilot} pilot, {flights} flights a world, seed {seed}")
    table.add_column("world")
    for column in ("MSF [m]", "± [m]", "median [m]", "longest [m]", "reached 1 km"):
        table.add_column(escape(column), justify="right")
    for r in results:
        table.add_row(
            r.scene, f"{r.msf:.1f}", f"{r.deviation:.1f}", f"{r.median:.1f}", f"{r.longest:.1f}",
            f"{r.capped:.0%}",
        )  # fmt: skip
    Console().print(table)
    return results
