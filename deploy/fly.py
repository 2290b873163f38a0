"""Hand-made pilots, and how far they fly: ``swarm fly --pilot greedy|straight|random``.

They bracket what a learned policy may reach: `random` and `straight` need no eyes, `greedy` reads
the depth map that a policy never sees.  MSF (mean safe flight) is the mean horizontal distance from
start to crash; every one of the parallel worlds flies the same number of flights, because counting
the first that end would favour short ones.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import gymnasium
import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table

from sim.indoor.camera import Camera
from sim.indoor.flights import GRID, RADIUS, YAW_STEP
from sim.indoor.scenes import NAMES

Actions = npt.NDArray[np.int64]
Depths = npt.NDArray[np.float32]  # (n, H, W) [m]

STRAIGHT = 2 * GRID + 2  # the action in the middle
MAX_STEPS = 2500  # 1 km; the cap of an evaluation
PARALLEL = 16  # flights at a time


class Pilot(Protocol):
    """Decides from depth maps; ``fresh`` says which flights have just begun."""

    def act(self, depth: Depths, fresh: npt.NDArray[np.bool_]) -> Actions: ...


class Random:
    """Any of the 25 actions."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random

    def act(self, depth: Depths, fresh: npt.NDArray[np.bool_]) -> Actions:
        return self._random.integers(GRID * GRID, size=len(depth))


class Straight:
    """Always ahead; the noise of the actions is the only turn."""

    def act(self, depth: Depths, fresh: npt.NDArray[np.bool_]) -> Actions:
        return np.full(len(depth), STRAIGHT, np.int64)


class Greedy:
    """Towards the heading along which a lane for the drone and its margin stays free longest.

    Headings across the whole view are tried.  Near obstacles count in a wide lane, far ones in a
    narrow one, so that gaps are seen early and corners are not cut.  When nothing ahead is free it
    turns hard, and keeps to that side until it sees a way out.
    """

    REACH = 9.0  # m; more than that ahead is as good
    STUCK = 2.6  # m; less than that in every direction: turn on the spot as hard as possible
    MARGIN = 0.75  # m, from the drone's skin to the lane's edge, near by
    SWERVE = 1.2  # m of reach that a straight flight is worth more than one to the edge of the view

    def __init__(self, camera: Camera | None = None) -> None:
        camera = camera or Camera()
        across, down = camera.tangents
        self._across = across * (2 * (np.arange(camera.width) + 0.5) / camera.width - 1)
        self._down = down * (2 * (np.arange(camera.height) + 0.5) / camera.height - 1)
        self._headings = np.linspace(-0.66, 0.66, 19)  # rad, to the right
        self._side: npt.NDArray[np.float64] = np.zeros(0)

    def act(self, depth: Depths, fresh: npt.NDArray[np.bool_]) -> Actions:
        if len(self._side) != len(depth):
            self._side = np.zeros(len(depth))
        self._side[fresh] = 0.0
        return np.array([self._decide(i, picture) for i, picture in enumerate(depth)], np.int64)

    def _decide(self, i: int, depth: npt.NDArray[np.float32]) -> int:
        depth = np.minimum(depth, 20.0)
        free = self._free(depth)
        score = np.minimum(free, self.REACH) - self.SWERVE * (self._headings / 0.66) ** 2
        best = int(np.argmax(score))
        if free[best] < self.STUCK:
            if self._side[i] == 0.0:
                half = len(free) // 2
                self._side[i] = 1.0 if free[half + 1 :].mean() > free[:half].mean() else -1.0
            turn = 2 * self._side[i]
        else:
            self._side[i] = 0.0
            turn = float(np.clip(np.round(self._headings[best] / YAW_STEP), -2, 2))
        return GRID * (2 + self._climb(depth)) + 2 + int(turn)

    def _free(self, depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """How far ahead the lane along each heading is free [m]."""
        height = depth * self._down[:, None]
        level = np.abs(height) < RADIUS + 0.35  # what the drone could touch at its height
        ahead = np.where(level, depth, np.inf).min(axis=0)  # per column
        side = ahead * self._across
        seen = np.isfinite(ahead)
        x, y = ahead[seen], side[seen]
        free = np.empty(len(self._headings))
        for k, heading in enumerate(self._headings):
            along = x * np.cos(heading) + y * np.sin(heading)
            off = np.abs(y * np.cos(heading) - x * np.sin(heading))
            lane = RADIUS + self.MARGIN * np.clip(1.6 - along / 6.0, 0.5, 1.0)
            blocking = along[(off < lane) & (along > 0.0)]
            free[k] = blocking.min() if len(blocking) else 20.0
        return free

    def _climb(self, depth: npt.NDArray[np.float32]) -> int:
        """-1 up, 0, 1 down: towards the middle between floor and ceiling."""
        below = float(np.median(depth[-8:] * self._down[-8:, None]))
        above = float(np.median(depth[:8] * -self._down[:8, None]))
        return int(np.clip(np.round((below - above) / 0.8), -1, 1))


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


def make_pilot(name: str, seed: int) -> Pilot:
    """A pilot by its name."""
    if name == "random":
        return Random(np.random.default_rng(seed))
    if name == "straight":
        return Straight()
    if name == "greedy":
        return Greedy()
    raise ValueError(f"no pilot {name!r}: expected greedy, straight or random")


def measure(scene: str, pilot: str, flights: int, seed: int) -> Result:
    """Fly, and measure the distances; the same seed gives the same numbers."""
    count = min(PARALLEL, flights)
    quota = np.full(count, flights // count) + (np.arange(count) < flights % count)
    envs: Any = gymnasium.make_vec(
        "sim:IndoorFlight-v0",
        num_envs=count,
        scene=scene,
        max_steps=MAX_STEPS,
        vectorization_mode="vector_entry_point",
    )
    hand = make_pilot(pilot, seed)
    distances: list[float] = []
    capped = 0
    envs.reset(seed=seed)
    fresh = np.ones(count, np.bool_)
    while quota.any():
        _, _, crashed, late, infos = envs.step(hand.act(envs.depth, fresh))
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
    flights: int = 100,
    seed: int = 0,
    *,
    as_json: bool = False,
) -> list[Result]:
    """Measure a pilot in some worlds and print a table, or JSON."""
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
