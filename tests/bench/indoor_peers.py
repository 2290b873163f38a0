"""MuJoCo and PyBullet in the worlds of ``sim/indoor``: the same triangles, the same camera."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sim.indoor.geometry.mesh import Doubles, Mesh
from sim.indoor.render.camera import Camera, Renderer
from tests.bench.clock import cpu_seconds

Speed = tuple[float, float]  # RGB-D frames a CPU-second, share of depths within 2% of ours


def export(mesh: Mesh, chosen: np.ndarray[Any, np.dtype[np.intp]], path: Path) -> None:
    """Some triangles as OBJ, x north, y west, z up, with texture coordinates."""
    corner = mesh.corner[chosen].astype(np.float64)
    paint = mesh.paint[chosen].astype(np.float64)
    uv = np.einsum("tkj,tcj->tck", paint[..., :3], corner) + paint[:, None, :, 3]
    uv /= (1 << mesh.texture[chosen, 1])[:, None, None]
    lines = [f"v {x:.6f} {-y:.6f} {-z:.6f}" for x, y, z in corner.reshape(-1, 3)]
    lines += [f"vt {u:.6f} {1 - v:.6f}" for u, v in uv.reshape(-1, 2)]
    lines += [
        "f " + " ".join(f"{3 * t + k}/{3 * t + k}" for k in (1, 2, 3)) for t in range(len(chosen))
    ]
    path.write_text("\n".join(lines) + "\n")


def mujoco_world(mesh: Mesh, folder: Path, *, textured: bool) -> tuple[str, str]:
    """MJCF assets and geoms: one grey mesh, or one mesh for each of our textures."""
    plain = 'type="mesh" contype="0" conaffinity="0"'
    if not textured:
        export(mesh, np.arange(mesh.triangles), folder / "world.obj")
        return (
            f'<mesh name="world" file="{folder}/world.obj" inertia="shell"/>',
            f'<geom {plain} mesh="world"/>',
        )
    from PIL import Image

    assets, geoms = "", ""
    firsts, group = np.unique(mesh.texture[:, 0], return_inverse=True)
    for k, first in enumerate(firsts):
        chosen = np.flatnonzero(group == k)
        side = 1 << int(mesh.texture[chosen[0], 1])
        words = mesh.texels[first : first + side * side].reshape(side, side)
        pixels = np.stack([words >> shift & 255 for shift in (0, 8, 16)], axis=-1)
        Image.fromarray(pixels.astype(np.uint8)).save(folder / f"{k}.png")
        export(mesh, chosen, folder / f"{k}.obj")
        assets += f'<texture type="2d" name="t{k}" file="{folder}/{k}.png"/>'
        assets += f'<material name="t{k}" texture="t{k}"/>'
        assets += f'<mesh name="m{k}" file="{folder}/{k}.obj" inertia="shell"/>'
        geoms += f'<geom {plain} mesh="m{k}" material="t{k}"/>'
    return assets, geoms


def mujoco_model(mesh: Mesh, folder: Path, *, stripped: bool, textured: bool) -> Any:
    """The scene with our camera on a mocap body."""
    import mujoco

    camera = Camera()
    across, down = camera.tangents
    assets, geoms = mujoco_world(mesh, folder, textured=textured)
    quality = '<quality shadowsize="0" offsamples="0"/>' if stripped else ""
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco><asset>{assets}</asset>
        <visual><map znear="0.0005" zfar="2"/>{quality}
          <global offwidth="{camera.width}" offheight="{camera.height}"/></visual>
        <worldbody><light pos="0 0 2.9" castshadow="{"false" if stripped else "true"}"/>
          <body name="eye" mocap="true"><camera name="eye" sensorsize="{2 * across} {2 * down}"
            focal="1 1" resolution="{camera.width} {camera.height}"/></body>
          {geoms}</worldbody></mujoco>""")


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


def mujoco_frames(mesh: Mesh, folder: Path, poses: Doubles) -> Speed:
    """As it comes: RGB-D frames a CPU-second, share of depths within 2% of ours."""
    import mujoco

    model = mujoco_model(mesh, folder, stripped=False, textured=True)
    data = mujoco.MjData(model)
    with mujoco.Renderer(model, Camera().height, Camera().width) as renderer:

        def look(pose: Doubles) -> Any:
            mujoco_place(model, data, pose)
            renderer.update_scene(data, camera="eye")
            renderer.disable_depth_rendering()
            renderer.render()
            renderer.enable_depth_rendering()
            return renderer.render()

        return measure(look, mesh, poses)


def mujoco_stripped_frames(
    mesh: Mesh, folder: Path, poses: Doubles, *, textured: bool = True
) -> Speed:
    """Without shadows, multisampling and Python's renderer; colour and depth from one pass."""
    import mujoco

    camera = Camera()
    model = mujoco_model(mesh, folder, stripped=True, textured=textured)
    data = mujoco.MjData(model)
    context = mujoco.GLContext(camera.width, camera.height)
    context.make_current()
    scene = mujoco.MjvScene(model, maxgeom=100)
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

    result = measure(look, mesh, poses)
    render.free()
    context.free()
    return result


def mujoco_grey_frames(mesh: Mesh, folder: Path, poses: Doubles) -> Speed:
    """Stripped, and without textures too."""
    return mujoco_stripped_frames(mesh, folder, poses, textured=False)


def pybullet_frames(mesh: Mesh, folder: Path, poses: Doubles, *, stripped: bool = False) -> Speed:
    """RGB-D frames a CPU-second, share of depths within 2% of ours."""
    import pybullet

    camera = Camera()
    across, down = camera.tangents
    near, far = 0.05, 100.0
    obj = folder / "world.obj"
    export(mesh, np.arange(mesh.triangles), obj)
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

    result = measure(look, mesh, poses)
    pybullet.disconnect(client)
    return result


def pybullet_stripped_frames(mesh: Mesh, folder: Path, poses: Doubles) -> Speed:
    """Without shadow and mask."""
    return pybullet_frames(mesh, folder, poses, stripped=True)


def measure(look: Callable[[Doubles], Any], mesh: Mesh, poses: Doubles) -> Speed:
    """A peer's frames a CPU-second, and how far its depth is ours."""
    ours = Renderer(mesh, Camera(), smooth=False)
    agree = []
    for pose in poses[:10]:
        expected = ours.look(pose).depth
        agree.append(np.mean(np.abs(look(pose) - expected) < 0.02 * expected))

    def work() -> None:
        for pose in poses:
            look(pose)

    return len(poses) / cpu_seconds(work, 3), float(np.mean(agree))
