"""One drone in one world, as a Gymnasium environment: ``gymnasium.make("sim:IndoorFlight-v0")``."""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from sim.indoor.content.naming import join
from sim.indoor.content.scene import load
from sim.indoor.errors import PoseError, checked_pose
from sim.indoor.flight.body import Body, make_bodies
from sim.indoor.flight.flights import ACTIONS, Flights
from sim.indoor.geometry.mesh import Doubles, Floats
from sim.indoor.render.camera import Camera, Renderer

Observation = npt.NDArray[np.uint8]
RENDER = Camera(height=180, width=320)  # PEDRA's picture


class IndoorFlight(gymnasium.Env[Observation, np.int64]):
    """Fly as far as you can without touching anything, by what one camera sees.

    ## Description
    A drone in a closed indoor world, after PEDRA, the simulator of the paper's drone experiment.
    Every step it turns its nose and advances 0.4 m.  Our worlds are loops: good pilots never stop.

    ## Observation Space
    ``Box(0, 255, (103, 103, 3), uint8)``: RGB, 80 degrees wide, 16:9 (see ``camera.py``).  The
    metric depth of the same picture is ``env.unwrapped.depth`` (float32 [m], along the optical
    axis); it is not part of the observation.

    ## Action Space
    ``Discrete(25)``: ``5 i + j``; j turns the nose by -21.3, -10.7, 0, 10.7 or 21.3 degrees
    (positive to the right), i descends at -12, -6, 0, 6 or 12 degrees (positive down); then the
    drone advances 0.4 m horizontally along its new heading.  12 is straight ahead.  Both angles
    carry uniform noise of a sixth of their step.  The camera stays level.

    ## Rewards
    PEDRA's dynamic windowing (``reward.py``): 0 to 1, the depth of the nearest things ahead over
    19.6 m; -1 for a crash.

    ## Starting State
    One of the scene's start poses, 1.5 m above the floor; with ``options={"pose": (x, y, z, yaw)}``
    wherever you like, with ``options={"start": k}`` at start ``k``.  The seed governs all chance,
    that of the body (gusts, noise) included.

    ## Episode End
    *Terminated* by a crash: the drone (a sphere of 0.25 m) touches something, or the reward falls
    under 0.07 (1.37 m), or the drone leaves the world's bounds.  *Truncated* after ``max_steps``;
    ``None`` is never.

    ## Information
    ``distance``: metres flown horizontally in this episode (safe flight); ``pose``: x, y, z [m,
    NED: north, east, down], roll, pitch, yaw [rad, yaw clockwise from north]; ``touched``: whether
    the drone touches something.

    ## Arguments
    ``scene``: a name (``sim.indoor.content.scenes.NAMES``) or the path of a .glb, .gltf, .obj or
    .ply file; ``scene_options``: ``open`` and ``starts`` of a file (``sim.indoor.content.naming``),
    which may stand in its name instead, ``"hall.ply?open"``; ``body``: ``"kinematic"``;
    ``"mavlink"``, a simulated vehicle with a MAVLink autopilot, in lockstep (``body_options``:
    arguments of ``sim.vehicle.bodies.lockstep_bodies``); ``"module:maker"``; or any object with the
    ``Body`` protocol (``sim.indoor.flight.body``); ``camera``: another size or field of view;
    ``max_steps``; ``render_mode``: ``"rgb_array"``, PEDRA's picture of 320 x 180.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (Gymnasium declares it so)
        "render_modes": ["rgb_array"],
        "render_fps": 5,
        "observations": "RGB of a camera ahead, 80 degrees wide, 16:9",
        "actions": "5 i + j: turn by -21.3, -10.7, 0, 10.7 or 21.3 degrees (j, positive to the "
        "right) and advance 0.4 m, descending at -12, -6, 0, 6 or 12 degrees (i)",
    }

    def __init__(
        self,
        scene: str = "indoor-long",
        body: str | Body = "kinematic",
        *,
        body_options: dict[str, Any] | None = None,
        scene_options: Mapping[str, Any] | None = None,
        max_steps: int | None = None,
        camera: Camera | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.render_mode = checked_mode(render_mode)
        self.camera = camera or Camera()
        self.max_steps = checked_steps(max_steps)
        self.scene = load(join(scene, scene_options))
        self._bodies = make_bodies(body, [self.scene], body_options)
        self._flights = Flights([self.scene], self.camera, self._bodies)
        self._renderer: Renderer | None = None
        shape = (self.camera.height, self.camera.width, 3)
        self.observation_space = spaces.Box(0, 255, shape, np.uint8)
        self.action_space = spaces.Discrete(ACTIONS)

    @property
    def depth(self) -> Floats:
        """Metric depth of the last observation (H, W) [m]; `inf` where nothing is."""
        depth: Floats = self._flights.depth[0]
        return depth

    @property
    def picture(self) -> Observation:
        """The last observation."""
        picture: Observation = self._flights.rgb[0]
        return picture

    @property
    def pose(self) -> Doubles:
        """x, y, z [m, NED], roll, pitch, yaw [rad]."""
        pose: Doubles = self._flights.pose[0].copy()
        return pose

    def _info(self) -> dict[str, Any]:
        return {
            "distance": float(self._flights.distance[0]),
            "pose": self.pose,
            "touched": bool(self._flights.touched[0]),
        }

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a flight; the class says where."""
        super().reset(seed=seed)
        pose = start_pose(options or {}, self.scene.starts)
        self._flights.fresh_pictures()
        self._flights.touched[0] = False
        self._flights.begin(0, self.np_random, pose)
        return self._flights.rgb[0], self._info()

    def step(self, action: np.int64 | int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Turn, advance 0.4 m, look."""
        flights = self._flights
        flights.fresh_pictures()
        flights.step(np.atleast_1d(action), [self.np_random])
        crashed = bool(flights.crashed[0])
        late = self.max_steps is not None and int(flights.steps[0]) >= self.max_steps
        return flights.rgb[0], float(flights.reward[0]), crashed, late and not crashed, self._info()

    def render(self) -> Observation | None:
        """The drone's view at 320 x 180 (`rgb_array`), else nothing."""
        if self.render_mode != "rgb_array":
            return None
        if self._renderer is None:
            self._renderer = Renderer(self.scene.mesh, RENDER)
        return self._renderer.look(self._flights.pose[0]).rgb

    def close(self) -> None:
        """Let go of the body."""
        for body in self._bodies or ():
            body.close()


def checked_mode(mode: str | None) -> str | None:
    """A render mode.

    Raises:
        ValueError: there is no such mode.
    """
    if mode not in {None, "rgb_array"}:
        raise ValueError(f'render_mode = {mode!r}: expected "rgb_array" or None')
    return mode


def checked_steps(steps: int | None) -> int | None:
    """The longest episode [steps]; None: without end.

    Raises:
        ValueError: it has no steps.
    """
    if steps is not None and not (isinstance(steps, int) and steps >= 1):
        raise ValueError(f"max_steps = {steps!r}: expected a whole number from 1 on, or None")
    return steps


def start_pose(options: dict[str, Any], starts: Doubles) -> Doubles | None:
    """The pose (6,) that reset's options ask for; None: any of the starts.

    Raises:
        ValueError: an option is none.
        PoseError: the pose is none.
    """
    if unknown := set(options) - {"pose", "start"}:
        raise ValueError(f'reset option "{min(unknown)}": expected "pose" or "start"')
    if "pose" in options:
        place = options["pose"]
        if len(place) != 4:
            raise PoseError(f'options["pose"] = {place}: expected x, y, z, yaw')
        x, y, z, yaw = place
        return checked_pose((x, y, z, 0.0, 0.0, yaw), 'options["pose"]')
    if "start" in options:
        start = options["start"]
        if not 0 <= start < len(starts):
            raise ValueError(f'options["start"] = {start}: expected 0 to {len(starts) - 1}')
        pose: Doubles = starts[int(start)]
        return pose
    return None
