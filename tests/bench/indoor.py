"""How fast the indoor worlds are: ours, MuJoCo and PyBullet in one run, on one scene, one machine.

Times are CPU-seconds of the process (all its threads), the best of several rounds, so that a busy
machine disturbs little.  The peers render the same triangles with the same camera, in two ways:

* as it comes: MuJoCo's ``Renderer``, colour then depth, with its default quality (shadows, four
  samples a pixel) and our textures; PyBullet's ``getCameraImage`` as gym-pybullet-drones calls it
  (shadow, object mask), grey.  The requirement is about these: the pictures that people train on.
* stripped: everything off that can be, and for MuJoCo its C calls, colour and depth from one pass.
  MuJoCo then draws with our textures and one light without shadow; grey is without textures too.

Needs ``pip install -r requirements-bench.lock`` and the Debian packages libegl1 libegl-mesa0
libgl1-mesa-dri (or libosmesa6 and MUJOCO_GL=osmesa); without them only our own part is printed.
"""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.table import Table

from sim.indoor.content.scene import Scene, load
from sim.indoor.content.scenes import TRAINED
from sim.indoor.geometry.mesh import Doubles
from sim.indoor.render.camera import Camera, Renderer
from tests.bench import indoor_peers
from tests.bench.clock import cpu_seconds

POSES = 200
PEER_POSES = 40
PEER_SCENE = "indoor-long"
SECONDS = 4.0  # wall clock, of a worker of the scaling test
REQUIRED = {"frames": 2000.0, "steps": 1500.0, "ratio": 12.0}
MESA = {"LIBGL_ALWAYS_SOFTWARE": "1", "LP_NUM_THREADS": "0"}


def poses_of(scene: str, count: int) -> Doubles:
    """Where drones are that fly mostly straight ahead."""
    envs: Any = gymnasium.make_vec(
        "sim:IndoorFlight-v0", num_envs=8, scene=scene, vectorization_mode="vector_entry_point"
    )
    rng = np.random.default_rng(0)
    envs.reset(seed=0)
    poses: list[Doubles] = []
    while len(poses) < count:
        poses += list(envs.pose)
        envs.step(rng.choice([11, 12, 12, 12, 13], size=8))
    return np.array(poses[:count])


def our_frames(scene: Scene, poses: Doubles) -> float:
    """RGB-D frames a CPU-second."""
    renderer = Renderer(scene.mesh, Camera(), smooth=False)
    renderer.look(poses[0])

    def work() -> None:
        for pose in poses:
            renderer.look(pose)

    return len(poses) / cpu_seconds(work)


def our_steps(scene: str | list[str], count: int = 16) -> float:
    """Whole steps a CPU-second: move, collide, render, reward, autoreset."""
    envs: Any = gymnasium.make_vec(
        "sim:IndoorFlight-v0", num_envs=count, scene=scene, vectorization_mode="vector_entry_point"
    )
    rng = np.random.default_rng(0)
    actions = rng.choice([11, 12, 12, 12, 13], size=(60, count))
    envs.reset(seed=0)
    envs.step(actions[0])

    def work() -> None:
        for action in actions:
            envs.step(action)

    return actions.size / cpu_seconds(work)


WORKER = f"""
import sys, time
began = time.time()
import gymnasium, numpy
envs = gymnasium.make_vec("sim:IndoorFlight-v0", num_envs=16, scene="{PEER_SCENE}",
                          vectorization_mode="vector_entry_point")
envs.reset(seed=0); envs.step(numpy.full(16, 12))
ready, cpu = time.time() - began, time.process_time()
rss = int(open('/proc/self/status').read().split('VmHWM:')[1].split()[0]) / 1024
steps, start, used = 0, time.time(), time.process_time()
while time.time() - start < float(sys.argv[1]):
    envs.step(numpy.full(16, 12)); steps += 16
print(ready, cpu, rss, steps / (time.time() - start), steps / (time.process_time() - used))
"""


def workers(count: int, seconds: float = SECONDS) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(count, 5): start-up [s], its CPU [s], RSS [MB], steps a second, steps a CPU-second."""
    command = [sys.executable, "-c", WORKER, str(seconds)]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(count)]
    rows = []
    for process in running:
        out, _ = process.communicate(timeout=120)
        rows.append([float(value) for value in out.split()])
    return np.array(rows)


def main() -> None:
    """Print the tables."""
    os.environ |= MESA
    os.environ.setdefault("MUJOCO_GL", "egl")
    console = Console(width=100)
    console.print("[bold]Indoor worlds[/], 103 x 103 RGB + depth, one thread, per CPU-second")

    table = Table(
        title=f"ours (required: {REQUIRED['frames']:.0f} frames, {REQUIRED['steps']:.0f} steps)"
    )
    for column in ("world", "triangles", "frames/s", "ms a frame", "env steps/s", "ms a step"):
        table.add_column(column, justify="left" if column == "world" else "right")
    speeds = {}
    for name in TRAINED:
        scene = load(name)
        frames, steps = our_frames(scene, poses_of(name, POSES)), our_steps(name)
        speeds[name] = frames
        table.add_row(
            name, f"{scene.mesh.triangles:,}", f"{frames:,.0f}", f"{1e3 / frames:.3f}",
            f"{steps:,.0f}", f"{1e3 / steps:.3f}",
        )  # fmt: skip
    steps = our_steps(list(TRAINED))
    table.add_row("all four in one batch", "", "", "", f"{steps:,.0f}", f"{1e3 / steps:.3f}")
    console.print(table)

    peers = Table(
        title=f"{PEER_SCENE}: ours against the peers (required: {REQUIRED['ratio']:.0f} x)"
    )
    for column in ("renderer", "frames/s", "ms a frame", "depth agrees", "ours is faster by"):
        peers.add_column(column, justify="left" if column == "renderer" else "right")
    poses = poses_of(PEER_SCENE, PEER_POSES)
    ours = our_frames(load(PEER_SCENE), poses)
    peers.add_row("ours (textured, lit)", f"{ours:,.0f}", f"{1e3 / ours:.3f}", "", "")
    for label, frames_of in (
        (f"MuJoCo ({os.environ['MUJOCO_GL']}) as it comes", indoor_peers.mujoco_frames),
        ("PyBullet TinyRenderer as it comes", indoor_peers.pybullet_frames),
        ("MuJoCo stripped", indoor_peers.mujoco_stripped_frames),
        ("MuJoCo stripped, grey", indoor_peers.mujoco_grey_frames),
        ("PyBullet stripped, grey", indoor_peers.pybullet_stripped_frames),
    ):
        try:
            with TemporaryDirectory() as folder:
                speed, agree = frames_of(load(PEER_SCENE).mesh, Path(folder), poses)
        except ImportError:
            peers.add_row(label, "pip install -r requirements-bench.lock", "", "", "")
            continue
        peers.add_row(
            label, f"{speed:,.1f}", f"{1e3 / speed:.2f}", f"{agree:.1%}", f"{ours / speed:.1f} x"
        )
    console.print(peers)

    one, two = workers(1), workers(2)
    process = Table(title=f"processes ({PEER_SCENE}, 16 flights each, warm cache)")
    for column in ("", "start-up s", "of it CPU s", "peak RSS MB", "steps/s", "steps/CPU-s"):
        process.add_column(column, justify="right")
    for label, rows in (("one process", one), ("two processes", two)):
        ready, cpu, rss = rows[:, 0].max(), rows[:, 1].max(), rows[:, 2].max()
        process.add_row(
            label, f"{ready:.2f}", f"{cpu:.2f}", f"{rss:.0f}", f"{rows[:, 3].sum():,.0f}",
            f"{rows[:, 4].sum():,.0f}",
        )  # fmt: skip
    process.add_row(
        "ratio", "", "", "", f"{two[:, 3].sum() / one[:, 3].sum():.2f}",
        f"{two[:, 4].sum() / one[:, 4].sum():.2f}",
    )  # fmt: skip
    console.print(process)


if __name__ == "__main__":
    main()
