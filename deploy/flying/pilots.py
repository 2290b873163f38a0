"""Hand-made pilots for the indoor worlds: greedy, straight, random.

They bracket what a learned policy may reach: `random` and `straight` need no eyes; `greedy` reads
the depth map and the pose, which a policy never sees, and remembers.
"""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from sim.indoor.compiled import compiled
from sim.indoor.flight.flights import ADVANCE, GRID, RADIUS, YAW_STEP
from sim.indoor.render.camera import Camera

Actions = npt.NDArray[np.int64]
Depths = npt.NDArray[np.float32]  # (n, H, W) [m]
Poses = npt.NDArray[np.float64]  # (n, 6): x, y, z [m, NED], roll, pitch, yaw [rad]
Flags = npt.NDArray[np.bool_]

STRAIGHT = 2 * GRID + 2  # the action in the middle
REACH = 8.0  # m; the greedy pilot ignores what is further away
MEMORY = 40  # steps that it remembers
COLUMN = 3  # of so many columns of the view it remembers one
HORIZON = 14  # steps that it looks ahead; 5.6 m
SAFE = RADIUS + 0.25  # m; nearer to anything its paths do not lead


class Pilot(Protocol):
    """Decides for n flights at once; ``fresh`` says which of them have just begun."""

    def act(self, depth: Depths, pose: Poses, fresh: Flags) -> Actions:
        """An action for every flight."""
        ...


class Random:
    """Any of the 25 actions."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random

    def act(self, depth: Depths, pose: Poses, fresh: Flags) -> Actions:
        """Draws each with the same chance."""
        return self._random.integers(GRID * GRID, size=len(depth))


class Straight:
    """Always ahead; the noise of the actions is the only turn."""

    def act(self, depth: Depths, pose: Poses, fresh: Flags) -> Actions:
        """The middle action."""
        return np.full(len(depth), STRAIGHT, np.int64)


class Greedy:
    """Remembers what it has seen lately at its height, and takes the path that stays free longest.

    A path is a turn held for some steps and a straight line after it.  It ends where the drone
    would come too near to something remembered, or would look at it from too near.  Of the paths
    that last, it prefers those that lead far away and keep their distance.
    """

    def __init__(self, flights: int, camera: Camera | None = None) -> None:
        camera = camera or Camera()
        across, down = camera.tangents
        columns = np.arange(COLUMN // 2, camera.width, COLUMN)
        self._across = across * (2 * (columns + 0.5) / camera.width - 1)
        self._down = down * (2 * (np.arange(camera.height) + 0.5) / camera.height - 1)
        self._seen = np.full((flights, MEMORY, len(columns), 2), np.nan)  # x, y [m, NED]
        self._next = np.zeros(flights, np.int64)

    def act(self, depth: Depths, pose: Poses, fresh: Flags) -> Actions:
        """Remember, plan, take the first step of the plan."""
        actions = np.empty(len(depth), np.int64)
        for i, picture in enumerate(depth):
            if fresh[i]:
                self._seen[i] = np.nan
            self._remember(i, np.minimum(picture, REACH), pose[i])
            points = self._seen[i].reshape(-1, 2)
            points = points[np.abs(points - pose[i, :2]).max(axis=1) < HORIZON * ADVANCE + 2.0]
            turn = plan(points, pose[i, 0], pose[i, 1], pose[i, 5])
            actions[i] = GRID * (2 + self._climb(picture)) + 2 + turn
        return actions

    def _remember(self, i: int, depth: npt.NDArray[np.float32], pose: Poses) -> None:
        """The nearest thing in every column of the view that a drone at this height could touch."""
        depth = depth[:, COLUMN // 2 :: COLUMN]
        level = np.abs(depth * self._down[:, None]) < RADIUS + 0.35
        ahead = np.where(level & (depth < REACH), depth, np.nan)
        with np.errstate(all="ignore"):
            x = np.fmin.reduce(ahead, axis=0)
        y = x * self._across
        c, s = np.cos(pose[5]), np.sin(pose[5])
        place = self._next[i] % MEMORY
        self._seen[i, place, :, 0] = pose[0] + c * x - s * y
        self._seen[i, place, :, 1] = pose[1] + s * x + c * y
        self._next[i] += 1

    def _climb(self, depth: npt.NDArray[np.float32]) -> int:
        """-1 up, 0, 1 down: towards the middle between floor and ceiling."""
        below = float(np.median(depth[-8:] * self._down[-8:, None]))
        above = float(np.median(depth[:8] * -self._down[:8, None]))
        return int(np.clip(np.round((below - above) / 0.8), -1, 1))


@compiled
def plan(points: Poses, x: float, y: float, yaw: float) -> int:
    """The turn (-2..2) that begins the best path past the points (m, 2)."""
    best, chosen = -np.inf, 0
    for turn in range(-2, 3):
        for hold in range(1, HORIZON + 1, 1 if turn != 0 else HORIZON):
            px, py, heading = x, y, yaw
            lasted, room = 0, 1.5
            for step in range(HORIZON):
                if step < hold:
                    heading += turn * YAW_STEP
                c, s = np.cos(heading), np.sin(heading)
                px += ADVANCE * c
                py += ADVANCE * s
                blocked = False
                for k in range(len(points)):
                    dx, dy = points[k, 0] - px, points[k, 1] - py
                    square = dx * dx + dy * dy
                    if square > 2.25:  # nothing within 1.5 m
                        continue
                    along, off = c * dx + s * dy, abs(c * dy - s * dx)
                    blocked |= square < SAFE * SAFE or off < 0.45 * along
                    room = min(room, np.sqrt(square))
                if blocked:
                    break
                lasted += 1
            away = np.hypot(px - x, py - y)
            value = lasted * ADVANCE + 0.4 * away + 0.8 * min(room, 1.2) - 0.02 * abs(turn)
            if value > best:
                best, chosen = value, turn
    return chosen


def make_pilot(name: str, seed: int, flights: int) -> Pilot:
    """A pilot by its name."""
    if name == "random":
        return Random(np.random.default_rng(seed))
    if name == "straight":
        return Straight()
    if name == "greedy":
        return Greedy(flights)
    raise ValueError(f"no pilot {name!r}: expected greedy, straight or random")
