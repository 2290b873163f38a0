"""How fast the indoor worlds are: ours, MuJoCo and PyBullet in one run, on one scene, one machine.

Times are CPU-seconds of the process (all its threads), the best of several rounds, so that a busy
machine disturbs little.  The peers render the same triangles with the same camera, in plain grey
(we paint textures and baked light), each in two ways:

* as it comes: MuJoCo's ``Renderer``, colour then depth, with its default quality (shadows, four
  samples a pixel); PyBullet's ``getCameraImage`` as gym-pybullet-drones calls it (shadow, object
  mask).  The requirement is about these: the pictures that people train on.
* stripped: everything off that can be, and for MuJoCo its C calls, colour and depth from one pass.

Needs ``pip install -r requirements-bench.lock`` and the Debian packages libegl1 libgl1-mesa-dri
(or libosmesa6) for the peers; without them only our own part is printed.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.table import Table

from sim.indoor.camera import Camera, Renderer
from sim.indoor.mesh import Doubles, Mesh
from sim.indoor.scene import Scene, load
from sim.indoor.scenes import TRAINED

ROUNDS = 5
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


def cpu_seconds(work: Callable[[], None], rounds: int = ROUNDS) -> float:
    """The least CPU time that `work` took."""
    best = np.inf
    for _ in range(rounds):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return float(best)


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


def export(mesh: Mesh, path: Path) -> None:
    """The triangles as OBJ, x north, y west, z up: what the peers read."""
    points = mesh.corner.reshape(-1, 3) * [1.0, -1.0, -1.0]
    unique, index = np.unique(points, axis=0, return_inverse=True)
    faces = index.reshape(-1, 3) + 1
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in unique]
    lines += [f"f {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


def mujoco_model(obj: Path, *, stripped: bool) -> Any:
    """The scene with our camera on a mocap body."""
    import mujoco

    camera = Camera()
    across, down = camera.tangents
    quality = '<quality shadowsize="0" offsamples="0"/>' if stripped else ""
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco><asset><mesh name="world" file="{obj}" inertia="shell"/></asset>
        <visual><map znear="0.0005" zfar="2"/>{quality}
          <global offwidth="{camera.width}" offheight="{camera.height}"/></visual>
        <worldbody><light pos="0 0 2.9" castshadow="{"false" if stripped else "true"}"/>
          <body name="eye" mocap="true"><camera name="eye" sensorsize="{2 * across} {2 * down}"
            focal="1 1" resolution="{camera.width} {camera.height}"/></body>
          <geom type="mesh" mesh="world" contype="0" conaffinity="0"/></worldbody></mujoco>""")


def mujoco_place(model: Any, data: Any, pose: Doubles) -> None:
    """Move the camera's body: a MuJoCo camera looks along -z with y up; yaw is about z up."""
    import mujoco

    data.mocap_pos[0] = pose[0], -pose[1], -pose[2]
    quat, half = np.empty(4), -pose[5] / 2
    about_z = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
    mujoco.mju_mulQuat(quat, about_z, np.array([0.5, 0.5, -0.5, -0.5]))
    data.mocap_quat[0] = quat
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def mujoco_frames(obj: Path, poses: Doubles) -> tuple[float, float]:
    """As it comes: RGB-D frames a CPU-second, share of depths within 2% of ours."""
    import mujoco

    model = mujoco_model(obj, stripped=False)
    data = mujoco.MjData(model)
    with mujoco.Renderer(model, Camera().height, Camera().width) as renderer:

        def look(pose: Doubles) -> Any:
            mujoco_place(model, data, pose)
            renderer.update_scene(data, camera="eye")
            renderer.disable_depth_rendering()
            renderer.render()
            renderer.enable_depth_rendering()
            return renderer.render()

        return measure(look, poses)


def mujoco_stripped_frames(obj: Path, poses: Doubles) -> tuple[float, float]:
    """Without shadows, multisampling and Python's renderer; colour and depth from one pass."""
    import mujoco

    camera = Camera()
    model = mujoco_model(obj, stripped=True)
    data = mujoco.MjData(model)
    context = mujoco.GLContext(camera.width, camera.height)
    context.make_current()
    scene = mujoco.MjvScene(model, maxgeom=10)
    scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
    render = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, render)
    option, perturb, view = mujoco.MjvOption(), mujoco.MjvPerturb(), mujoco.MjvCamera()
    view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, 0
    rgb = np.empty((camera.height, camera.width, 3), np.uint8)
    depth = np.empty((camera.height, camera.width), np.float32)
    rect = mujoco.MjrRect(0, 0, camera.width, camera.height)
    everything = mujoco.mjtCatBit.mjCAT_ALL
    near, far = 0.0005 * model.stat.extent, 2 * model.stat.extent

    def look(pose: Doubles) -> Any:
        mujoco_place(model, data, pose)
        mujoco.mjv_updateScene(model, data, option, perturb, view, everything, scene)
        mujoco.mjr_render(rect, scene, render)
        mujoco.mjr_readPixels(rgb, depth, rect, render)
        return near * far / (far - depth[::-1] * (far - near))

    result = measure(look, poses)
    render.free()
    context.free()
    return result


def pybullet_frames(obj: Path, poses: Doubles, *, stripped: bool = False) -> tuple[float, float]:
    """RGB-D frames a CPU-second, share of depths within 2% of ours."""
    import pybullet

    camera = Camera()
    across, down = camera.tangents
    near, far = 0.05, 100.0
    client = pybullet.connect(pybullet.DIRECT)
    shape = pybullet.createVisualShape(pybullet.GEOM_MESH, fileName=str(obj))
    pybullet.createMultiBody(baseVisualShapeIndex=shape)
    projection = pybullet.computeProjectionMatrix(
        -across * near, across * near, -down * near, down * near, near, far
    )
    mask = pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX
    flags = pybullet.ER_NO_SEGMENTATION_MASK if stripped else mask

    def look(pose: Doubles) -> Any:
        x, y, z, yaw = pose[0], -pose[1], -pose[2], -pose[5]
        target = [x + np.cos(yaw), y + np.sin(yaw), z]
        image = pybullet.getCameraImage(
            camera.width,
            camera.height,
            pybullet.computeViewMatrix([x, y, z], target, [0, 0, 1]),
            projection,
            shadow=0 if stripped else 1,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=flags,
        )
        shown = np.reshape(image[3], (camera.height, camera.width))
        return far * near / (far - (far - near) * shown)

    result = measure(look, poses)
    pybullet.disconnect(client)
    return result


def pybullet_stripped_frames(obj: Path, poses: Doubles) -> tuple[float, float]:
    """Without shadow and mask."""
    return pybullet_frames(obj, poses, stripped=True)


def measure(look: Callable[[Doubles], Any], poses: Doubles) -> tuple[float, float]:
    """A peer's frames a CPU-second, and how far its depth is ours."""
    ours = Renderer(load(PEER_SCENE).mesh, Camera(), smooth=False)
    agree = []
    for pose in poses[:10]:
        expected = ours.look(pose).depth
        agree.append(np.mean(np.abs(look(pose) - expected) < 0.02 * expected))

    def work() -> None:
        for pose in poses:
            look(pose)

    return len(poses) / cpu_seconds(work, 3), float(np.mean(agree))


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
    with TemporaryDirectory() as folder:
        obj = Path(folder) / "world.obj"
        export(load(PEER_SCENE).mesh, obj)
        for label, frames_of in (
            (f"MuJoCo ({os.environ['MUJOCO_GL']}) as it comes", mujoco_frames),
            ("PyBullet TinyRenderer as it comes", pybullet_frames),
            ("MuJoCo stripped", mujoco_stripped_frames),
            ("PyBullet stripped", pybullet_stripped_frames),
        ):
            try:
                speed, agree = frames_of(obj, poses)
            except ImportError:
                peers.add_row(label, "pip install -r requirements-bench.lock", "", "", "")
                continue
            peers.add_row(
                label,
                f"{speed:,.1f}",
                f"{1e3 / speed:.2f}",
                f"{agree:.1%}",
                f"{ours / speed:.1f} x",
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
