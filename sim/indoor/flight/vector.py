"""Many drones at once: ``gymnasium.make_vec("sim:IndoorFlight-v0", num_envs=16, ...)``."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from sim.indoor.content.naming import join
from sim.indoor.content.scene import load
from sim.indoor.flight.body import Body, make_bodies
from sim.indoor.flight.env import RENDER, checked_mode, checked_steps, start_pose
from sim.indoor.flight.flights import ACTIONS, Flights
from sim.indoor.geometry.mesh import Doubles, Floats
from sim.indoor.render.camera import Camera, Renderer

Observations = npt.NDArray[np.uint8]
Actions = npt.NDArray[np.int64]


class IndoorFlights(VectorEnv[Observations, Actions, npt.NDArray[Any]]):
    """``num_envs`` flights as ``IndoorFlight`` specifies them, stepped in one compiled call.

    ``scene`` is one scene for all or a list that is dealt out in turn.  Flight ``i`` with seed
    ``s + i`` is step by step the flight of ``IndoorFlight`` with that seed.

    Autoreset is SAME_STEP: where a flight ended, the observation is the first of the next flight,
    ``infos["final_obs"][i]`` the last of the old one and ``infos["final_info"]`` its info.  The
    arrays that ``step`` returns are yours to keep.  ``depth`` (n, H, W) is that of the observation,
    and is overwritten.

    ``body``: as there, or a sequence of one ``Body`` a flight.  ``max_episode_steps``: Gymnasium's
    name of ``max_steps``; ``gymnasium.make`` cuts single flights by it.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (Gymnasium declares it so)
        "render_modes": ["rgb_array"],
        "render_fps": 5,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        scene: str | Sequence[str] = "indoor-long",
        body: str | Sequence[Body] = "kinematic",
        *,
        body_options: dict[str, Any] | None = None,
        scene_options: Mapping[str, Any] | None = None,
        max_steps: int | None = None,
        max_episode_steps: int | None = None,
        camera: Camera | None = None,
        render_mode: str | None = None,
    ) -> None:
        if max_steps is not None and max_episode_steps is not None:
            raise ValueError("max_steps and max_episode_steps: expected one of them")
        self.num_envs = num_envs
        self.render_mode = checked_mode(render_mode)
        self.max_steps = checked_steps(max_steps if max_steps is not None else max_episode_steps)
        self.camera = camera or Camera()
        given = [scene] if isinstance(scene, str) else scene
        names = [join(name, scene_options) for name in given]
        loaded = {name: load(name) for name in names}
        scenes = [loaded[names[i % len(names)]] for i in range(num_envs)]
        self._bodies = make_bodies(body, scenes, body_options)
        self._flights = Flights(scenes, self.camera, self._bodies)
        self._random = [seeding.np_random(None)[0] for _ in range(num_envs)]
        self._renderers: dict[str, Renderer] = {}
        shape = (self.camera.height, self.camera.width, 3)
        self.single_observation_space = spaces.Box(0, 255, shape, np.uint8)
        self.single_action_space = spaces.Discrete(ACTIONS)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    @property
    def depth(self) -> Floats:
        """Metric depth of the last observations (n, H, W) [m]; `inf` where nothing is."""
        return self._flights.depth

    @property
    def pose(self) -> Doubles:
        """(n, 6): x, y, z [m, NED], roll, pitch, yaw [rad]."""
        return self._flights.pose.copy()

    def _infos(self, which: npt.NDArray[np.bool_]) -> dict[str, Any]:
        """The flights' infos as Gymnasium's vector environments stack them."""
        flights = self._flights
        values = {"distance": flights.distance, "pose": flights.pose, "touched": flights.touched}
        infos: dict[str, Any] = {}
        for key, value in values.items():
            infos[key] = np.where(which if value.ndim == 1 else which[:, None], value, 0)
            infos[key] = infos[key].astype(value.dtype)
            infos[f"_{key}"] = which.copy()
        return infos

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin all flights, or with ``options["reset_mask"]`` some of them."""
        chosen = dict(options or {})
        which = np.asarray(chosen.pop("reset_mask", np.ones(self.num_envs, np.bool_)))
        if which.shape != (self.num_envs,) or which.dtype != np.bool_ or not which.any():
            raise ValueError(f"reset_mask: expected {self.num_envs} bools with at least one True")
        seeds = [None] * self.num_envs if seed is None else seed
        if isinstance(seeds, int):
            seeds = [seeds + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: expected {self.num_envs} seeds, got {len(seeds)}")
        pictures = self._flights.rgb
        self._flights.fresh_pictures()
        self._flights.rgb[:] = pictures
        for i in map(int, np.flatnonzero(which)):
            if seeds[i] is not None:
                self._random[i] = seeding.np_random(seeds[i])[0]
            self._begin(i, chosen)
        return self._flights.rgb, self._infos(which)

    def _begin(self, i: int, options: dict[str, Any]) -> None:
        pose = start_pose(options, self._flights.scenes[i].starts)
        self._flights.touched[i] = False
        self._flights.begin(i, self._random[i], pose)

    def step(
        self, actions: Actions
    ) -> tuple[Observations, Doubles, npt.NDArray[np.bool_], npt.NDArray[np.bool_], dict[str, Any]]:
        """One step of every flight; those that end begin again."""
        flights = self._flights
        flights.fresh_pictures()
        flights.step(np.asarray(actions), self._random)
        rewards, crashed = flights.reward.copy(), flights.crashed.copy()
        late = np.zeros(self.num_envs, np.bool_)
        if self.max_steps is not None:
            late = (flights.steps >= self.max_steps) & ~crashed
        ended = crashed | late
        final: dict[str, Any] = {}
        if ended.any():
            last = np.full(self.num_envs, None, object)
            final = {"final_info": self._infos(ended), "_final_info": ended.copy()}
            for i in np.flatnonzero(ended):
                last[i] = flights.rgb[i].copy()
                self._begin(int(i), {})
            final |= {"final_obs": last, "_final_obs": ended.copy()}
        infos = self._infos(np.ones(self.num_envs, np.bool_)) | final
        return flights.rgb, rewards, crashed, late, infos

    def render(self) -> tuple[npt.NDArray[Any], ...] | None:
        """Every drone's view at 320 x 180 (`rgb_array`), else nothing."""
        if self.render_mode != "rgb_array":
            return None
        views = []
        for i, scene in enumerate(self._flights.scenes):
            if scene.name not in self._renderers:
                self._renderers[scene.name] = Renderer(scene.mesh, RENDER)
            views.append(self._renderers[scene.name].look(self._flights.pose[i]).rgb)
        return tuple(views)

    def close_extras(self, **kwargs: Any) -> None:
        """Let go of the bodies."""
        for body in self._bodies or ():
            body.close()
