"""A contact sheet of the worlds: the floor plan from above and what the camera sees.

``swarm worlds --sheet out.png``; the one in ``deploy/docs/pictures`` has ``--width 1464``.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from agent.storage.files import drafted
from sim.indoor.content.scene import Scene, load
from sim.indoor.content.scenes import NAMES
from sim.indoor.render.camera import Camera, Renderer

Picture = npt.NDArray[np.uint8]

TILE = (270, 480)  # pixels of one view
OVER = 2  # samples a pixel, in each direction
VIEWS = 5  # from the camera, beside the plan
GAP = 6  # pixels between the tiles
LABEL = 40  # pixels for a world's name, below its plan
ALTITUDE = 400.0  # m; from so high a plan has hardly any perspective
PAPER = 20  # grey of the sheet


def view(scene: Scene, pose: Sequence[float], camera: Camera) -> Picture:
    """One picture, sampled more finely than it is shown."""
    fine = Camera(camera.height * OVER, camera.width * OVER, camera.hfov, camera.aspect)
    rgb = Renderer(scene.mesh, fine).look(pose).rgb
    bright = rgb.reshape(camera.height, OVER, camera.width, OVER, 3).astype(np.float64) ** 2.2
    return np.asarray((bright.mean(axis=(1, 3)) ** (1 / 2.2)).astype(np.uint8))


def floor_plan(scene: Scene) -> Picture:
    """The world from above, north up, without its ceiling (which shows no back faces)."""
    points = scene.mesh.corner.reshape(-1, 3).astype(np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    north, east = (low[:2] + high[:2]) / 2
    aspect = TILE[1] / TILE[0]
    span = 1.04 * max(high[1] - low[1], (high[0] - low[0]) * aspect * TILE[0] / (TILE[0] - LABEL))
    north -= span / TILE[1] * LABEL / 2  # the name stands below
    camera = Camera(*TILE, hfov=2 * float(np.arctan(span / 2 / ALTITUDE)), aspect=aspect)
    picture = view(scene, [north, east, low[2] - ALTITUDE, 0.0, -np.pi / 2, 0.0], camera)
    picture[(picture == 0).all(axis=2)] = PAPER
    return picture


def panel(scene: Scene) -> Picture:
    """Plan and views of one world, three in a row."""
    eye = Camera(*TILE, aspect=TILE[1] / TILE[0])
    tiles = [floor_plan(scene)]
    poses = scene.views if len(scene.views) else scene.starts
    tiles += [view(scene, list(pose), eye) for pose in poses[:VIEWS]]
    tiles += [np.full((*TILE, 3), PAPER, np.uint8)] * (VIEWS + 1 - len(tiles))
    wide = 3 * TILE[1] + 4 * GAP
    sheet = np.full((2 * TILE[0] + 3 * GAP, wide, 3), PAPER, np.uint8)
    for k, tile in enumerate(tiles):
        top = GAP + (k // 3) * (TILE[0] + GAP)
        left = GAP + (k % 3) * (TILE[1] + GAP)
        sheet[top : top + TILE[0], left : left + TILE[1]] = tile
    return sheet


def sheet(path: str | Path, scenes: Sequence[str] = NAMES, width: int | None = None) -> Path:
    """Write the contact sheet of some worlds, two beside each other, and print a table of them.

    With a `width` [pixels] it is reduced to that and to 256 colours, for a page.
    """
    worlds = [load(name) for name in scenes]
    columns = min(2, len(worlds))
    panels = []
    for world in worlds:
        image = Image.fromarray(panel(world))
        pen = ImageDraw.Draw(image)
        font = ImageFont.load_default(size=26)
        label = Path(world.name).name
        pen.text((GAP + 10, GAP + TILE[0] - 36), label, font=font, fill=(240, 240, 235))
        panels.append(np.asarray(image))
    while len(panels) % columns:
        panels.append(np.full_like(panels[0], PAPER))
    rows = [np.concatenate(panels[k : k + columns], axis=1) for k in range(0, len(panels), columns)]
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    whole = Image.fromarray(np.concatenate(rows))
    if width is not None:
        size = (width, whole.height * width // whole.width)
        whole = whole.resize(size, Image.Resampling.LANCZOS)
        palette = whole.quantize(256, method=Image.Quantize.FASTOCTREE)
        whole = whole.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)
    with drafted(target) as draft:
        whole.save(draft, optimize=True)
    describe(worlds)
    Console().print(f"contact sheet: {target}")
    return target


def describe(worlds: Sequence[Scene]) -> None:
    """A table of what the worlds are made of."""
    table = Table(title="worlds")
    table.add_column("world")
    for column in ("size [m]", "height [m]", "triangles", "light texels", "MB", "starts"):
        table.add_column(escape(column), justify="right")
    for world in worlds:
        mesh = world.mesh
        north, east = np.ptp(mesh.corner.reshape(-1, 3), axis=0)[:2]
        size = sum(array.nbytes for array in mesh) / 1e6
        table.add_row(
            Path(world.name).name, f"{east:.0f} x {north:.0f}", f"{world.height:.1f}",
            f"{mesh.triangles:,}", f"{len(mesh.light):,}", f"{size:.1f}", f"{len(world.starts)}",
        )  # fmt: skip
    Console().print(table)


def worlds(
    scenes: Sequence[str] = NAMES, out: str | Path | None = None, width: int | None = None
) -> None:
    """List the worlds; with `out`, draw their contact sheet too."""
    if out is None:
        describe([load(name) for name in scenes])
    else:
        sheet(out, scenes, width)
