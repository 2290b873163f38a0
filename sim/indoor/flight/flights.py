"""Several flights side by side, each in its world: what one step means, without Gymnasium.

The single and the vector environment are both thin covers of ``Flights``, so that they agree to
the last bit.  With kinematic bodies a step of all flights is one compiled call: aim, move, touch,
look, reward.

Motion (PEDRA): action = 5 i + j.  The nose turns by (80/1.5)/5 (j - 2) degrees, positive to the
right; the drone advances 0.4 m horizontally along its new heading and 0.4 sin(theta) m down, with
theta = (45/1.5)/5 (i - 2) degrees.  Both angles carry uniform noise of a sixth of their step either
way.  The camera stays level.

A flight that leaves the world's bounds, through a hole that a file is allowed to have, has crashed.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim.indoor.compiled import compiled
from sim.indoor.content.scene import Scene
from sim.indoor.errors import checked_pose
from sim.indoor.flight.body import Body, Pose, SetPoint
from sim.indoor.flight.reward import CRASH_REWARD, CRASH_THRESHOLD, windowed
from sim.indoor.geometry.collision import sweep
from sim.indoor.geometry.mesh import Doubles, Floats, Mesh, merge
from sim.indoor.render.camera import Camera, look, somewhere
from sim.indoor.render.raster import Canvas, Flags, canvas
from sim.indoor.render.shade import Picture

GRID = 5  # actions a side
ACTIONS = GRID * GRID
YAW_STEP = float(np.radians(80 / 1.5 / GRID))
PITCH_STEP = float(np.radians(45 / 1.5 / GRID))
NOISE = 1 / 6  # of a step, either way
ADVANCE = 0.4  # m a step
LUCK = 1 << 24  # seeds of a body: as many as a float32 of a MAVLink command tells apart
RADIUS = 0.25  # m, of the sphere that is the drone; a guess: PEDRA's drone is about 0.5 m across


@compiled
def aim(pose: Doubles, action: int, noise: Doubles, target: Doubles) -> None:
    """Where an action leads: x, y, z, yaw.  `noise` is two numbers in -1..1, for pitch and yaw."""
    theta = PITCH_STEP * (action // GRID - 2 + NOISE * noise[0])
    yaw = pose[5] + YAW_STEP * (action % GRID - 2 + NOISE * noise[1])
    yaw = (yaw + np.pi) % (2 * np.pi) - np.pi
    target[0] = pose[0] + ADVANCE * np.cos(yaw)
    target[1] = pose[1] + ADVANCE * np.sin(yaw)
    target[2] = pose[2] + ADVANCE * np.sin(theta)
    target[3] = yaw


class Seen(NamedTuple):
    """What a step makes of n flights."""

    rgb: Picture  # (n, H, W, 3)
    depth: Floats  # (n, H, W) [m]
    reward: Doubles  # (n,)
    touched: Flags  # (n,) the sphere meets a surface
    crashed: Flags  # (n,) touched, too near, or outside the world


@compiled
def outside(mesh: Mesh, world: int, pose: Doubles) -> bool:
    """Whether a place is beyond the box around a world.  True for NaN."""
    root = mesh.root[world]
    for axis in range(3):
        if not mesh.box[root, axis] <= pose[axis] <= mesh.box[root, axis + 3]:
            return True
    return False


@compiled
def step(
    canvas: Canvas,
    mesh: Mesh,
    worlds: npt.NDArray[np.int64],
    before: Doubles,
    after: Doubles,
    flown: bool,
    actions: npt.NDArray[np.int64],
    noise: Doubles,
    tangents: tuple[float, float],
    seen: Seen,
) -> None:
    """Every drone moves from `before` to `after` (n, 6), touches, looks around, is rewarded.

    Where bodies have `flown`, `after` is what they report; else it is where the actions lead.  A
    drone that touches something stays at the point of contact: `after` is changed.
    """
    target = np.empty(4, np.float64)
    move = np.empty(3, np.float64)
    for i in range(len(after)):
        if not flown:
            aim(before[i], actions[i], noise[i], target)
            after[i, :3] = target[:3]
            after[i, 3] = after[i, 4] = 0.0
            after[i, 5] = target[3]
        for axis in range(3):
            move[axis] = after[i, axis] - before[i, axis]
        share = sweep(
            mesh.corner, mesh.box, mesh.link, mesh.root[worlds[i]], before[i, :3], move, RADIUS
        )
        seen.touched[i] = share <= 1.0
        if seen.touched[i]:
            for axis in range(3):
                after[i, axis] = before[i, axis] + share * move[axis]
        look(canvas, mesh, worlds[i], after[i], tangents, False, seen.rgb[i], seen.depth[i])
        reward = windowed(seen.depth[i])
        lost = outside(mesh, worlds[i], after[i]) or not somewhere(after[i])
        seen.crashed[i] = seen.touched[i] or lost or reward < CRASH_THRESHOLD
        seen.reward[i] = CRASH_REWARD if seen.crashed[i] else reward


class Flights:
    """The state of n flights: poses, pictures, distances."""

    def __init__(
        self, scenes: Sequence[Scene], camera: Camera, bodies: Sequence[Body] | None = None
    ) -> None:
        """One flight a scene; without bodies all drones are kinematic."""
        different = {id(scene): scene for scene in scenes}
        place = {key: world for world, key in enumerate(different)}
        self.mesh = merge([scene.mesh for scene in different.values()])
        self.scenes = list(scenes)
        self.camera = camera
        self.bodies = bodies
        count, shape = len(scenes), (camera.height, camera.width)
        self.worlds = np.array([place[id(scene)] for scene in scenes], np.int64)
        self.pose: Doubles = np.zeros((count, 6))  # x, y, z [m, NED], roll, pitch, yaw [rad]
        self.distance: Doubles = np.zeros(count)  # m flown horizontally
        self.steps = np.zeros(count, np.int64)
        self.rgb: Picture = np.zeros((count, *shape, 3), np.uint8)
        self.depth: Floats = np.zeros((count, *shape), np.float32)  # m
        self.reward: Doubles = np.zeros(count)
        self.touched: Flags = np.zeros(count, np.bool_)
        self.crashed: Flags = np.zeros(count, np.bool_)
        self._canvas = canvas(*shape, self.mesh.triangles)
        self._noise: Doubles = np.zeros((count, 2))

    def begin(self, i: int, random: np.random.Generator, pose: Doubles | None = None) -> None:
        """Start flight `i` anew, at `pose` or at one of its scene's starts, and look around.

        Raises:
            PoseError: the pose, or what the body reports, is none.
        """
        if pose is None:
            starts = self.scenes[i].starts
            pose = starts[random.integers(len(starts))]
        if self.bodies is not None:
            luck = int(random.integers(LUCK))  # the body's own chance follows the flight's seed
            self.bodies[i].place(Pose(*(float(value) for value in pose)), luck)
            pose = checked_pose(self.bodies[i].pose, f"the report of body {i}")
        self.pose[i] = pose
        self.distance[i], self.steps[i] = 0.0, 0
        look(
            self._canvas,
            self.mesh,
            self.worlds[i],
            self.pose[i],
            self.camera.tangents,
            False,
            self.rgb[i],
            self.depth[i],
        )

    def step(self, actions: npt.NDArray[np.int64], randoms: Sequence[np.random.Generator]) -> None:
        """One step of every flight.

        Raises:
            ValueError: an action is none.
            PoseError: a body reports a pose that is none.
        """
        if actions.shape != (len(randoms),) or actions.dtype.kind not in "iu":
            raise ValueError(f"actions {actions}: expected {len(randoms)} whole numbers")
        if wrong := [int(action) for action in actions if not 0 <= action < ACTIONS]:
            raise ValueError(f"action {wrong[0]}: expected 0 to {ACTIONS - 1}")
        for i, random in enumerate(randoms):
            self._noise[i] = random.uniform(-1.0, 1.0, 2)
        before = self.pose.copy()
        if self.bodies is not None:
            target = np.empty(4)
            for i, body in enumerate(self.bodies):
                aim(before[i], actions[i], self._noise[i], target)
                body.head_for(SetPoint(*(float(value) for value in target)))
            for i, body in enumerate(self.bodies):
                body.arrive()
                self.pose[i] = checked_pose(body.pose, f"the report of body {i}")
        step(
            self._canvas,
            self.mesh,
            self.worlds,
            before,
            self.pose,
            self.bodies is not None,
            actions,
            self._noise,
            self.camera.tangents,
            Seen(self.rgb, self.depth, self.reward, self.touched, self.crashed),
        )
        moved = self.pose[:, :2] - before[:, :2]
        self.distance += np.hypot(moved[:, 0], moved[:, 1])
        self.steps += 1

    def fresh_pictures(self) -> None:
        """Let go of the pictures handed out; the next step writes into new ones."""
        self.rgb = np.empty_like(self.rgb)
