"""Surfaces painted by code: plaster, brick, wood, tiles, stone; ``patterns`` has decorated ones.

Every function returns a ``Material``: how a surface looks and how many metres one repeat of its
picture spans.  ``mip_chain`` turns the picture into the words that the renderer reads.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from sim.indoor.geometry.mesh import Words

Image = npt.NDArray[np.float64]  # (side, side, 3), 0..1, gamma encoded
Map = npt.NDArray[np.float64]  # (side, side)

SIDE = 256  # texels of a painted picture
GAMMA = 2.2


@dataclass(frozen=True)
class Material:
    """A surface.  Materials with the same `key` share one picture."""

    key: str
    paint: Callable[[], Image]
    metres: float = 2.0  # what one repeat spans
    glow: float = 0.0  # light that it shows by itself; 1 is as bright as the picture allows


def mip_chain(image: Image) -> Words:
    """Every level, finest first, averaged in linear light, as 0x00BBGGRR words."""
    levels = []
    linear = np.asarray(image, np.float64) ** GAMMA
    while True:
        code = np.clip(linear ** (1 / GAMMA) * 255 + 0.5, 0, 255).astype(np.uint32)
        levels.append((code[..., 0] | code[..., 1] << 8 | code[..., 2] << 16).ravel())
        if len(linear) == 1:
            return np.concatenate(levels)
        linear = (
            linear[::2, ::2] + linear[1::2, ::2] + linear[::2, 1::2] + linear[1::2, 1::2]
        ) * 0.25


def colour(code: str) -> Image:
    """``#rrggbb`` as three numbers in 0..1."""
    return np.asarray([int(code[i : i + 2], 16) / 255 for i in (1, 3, 5)], np.float64)


# --- building blocks ------------------------------------------------------------------------------


def noise(seed: int, roughness: float = 1.6, stretch: float = 1.0) -> Map:
    """Tileable noise with mean 0 and deviation 1; `stretch` > 1 draws it out along the columns."""
    rng = np.random.default_rng(seed)
    fx = np.fft.fftfreq(SIDE)[None, :] * SIDE * stretch
    fy = np.fft.fftfreq(SIDE)[:, None] * SIDE
    radius = np.hypot(fx, fy)
    radius[0, 0] = np.inf
    spectrum = np.fft.fft2(rng.standard_normal((SIDE, SIDE))) * radius**-roughness
    field = np.fft.ifft2(spectrum).real
    field -= field.mean()
    field /= field.std()
    return field


def grid() -> tuple[Map, Map]:
    """Column and row of every texel centre in 0..1."""
    line = (np.arange(SIDE) + 0.5) / SIDE
    return np.broadcast_to(line[None, :], (SIDE, SIDE)), np.broadcast_to(
        line[:, None], (SIDE, SIDE)
    )


def cells(columns: int, rows: int, shift: float) -> tuple[Map, Map, npt.NDArray[np.int64]]:
    """A brick bond: place inside the cell (0..1, 0..1) and number of the cell."""
    x, y = grid()
    row = np.floor(y * rows)
    along = x * columns + (row * shift) % 1.0
    column = np.floor(along) % columns
    return along % 1.0, (y * rows) % 1.0, (row * columns + column).astype(np.int64)


def in_cell(x: Map, y: Map, width_x: float, width_y: float) -> Map:
    """0 in the joint between cells, 1 inside them, soft by a texel or two."""
    edge_x = np.minimum(x, 1 - x) / width_x
    edge_y = np.minimum(y, 1 - y) / width_y
    return np.clip(np.minimum(edge_x, edge_y) * 1.5 - 0.5, 0, 1)


def blend(low: Image, high: Image, share: Map) -> Image:
    return low + (high - low) * share[..., None]


def shaded(base: Image, light: Map) -> Image:
    return np.clip(base * light[..., None], 0, 1)


# --- materials ------------------------------------------------------------------------------------


def _paint_plain(tone: str) -> Image:
    return np.broadcast_to(colour(tone), (1, 1, 3)).copy()


def plain(tone: str, glow: float = 0.0) -> Material:
    """One colour."""
    return Material(f"plain {tone} {glow}", partial(_paint_plain, tone), 1.0, glow)


def _paint_plaster(tone: str, grain: float, seed: int) -> Image:
    mottle = 1 + grain * (0.6 * noise(seed, 1.8) + 0.5 * noise(seed + 1, 0.5))
    return shaded(np.broadcast_to(colour(tone), (SIDE, SIDE, 3)), mottle)


def plaster(tone: str, grain: float = 0.04, metres: float = 3.0, seed: int = 0) -> Material:
    """A painted wall, concrete or carpet: one colour, mottled."""
    return Material(
        f"plaster {tone} {grain} {seed}", partial(_paint_plaster, tone, grain, seed), metres
    )


def _paint_brick(
    tones: tuple[str, ...], mortar: str, columns: int, rows: int, rough: float, seed: int
) -> Image:
    rng = np.random.default_rng(seed)
    x, y, cell = cells(columns, rows, 0.5)
    palette = np.array([colour(tone) for tone in tones])
    pick = palette[rng.integers(len(tones), size=columns * rows)]
    pick = pick * rng.uniform(0.82, 1.12, (columns * rows, 1))
    wobble = rough * 0.02 * noise(seed + 7, 1.2)
    inside = in_cell(
        np.clip(x + wobble, 0, 1), np.clip(y + wobble, 0, 1), 0.10 * columns / rows, 0.10
    )
    bevel = 1 + 0.10 * np.clip(0.3 - y, 0, 1) - 0.35 * np.clip(y - 0.75, 0, 1)
    stone = shaded(pick[cell], bevel * (1 + 0.10 * rough * noise(seed + 3, 1.0)))
    bed = shaded(np.broadcast_to(colour(mortar), (SIDE, SIDE, 3)), 1 + 0.06 * noise(seed + 5, 0.6))
    return blend(bed, stone, inside)


def brick(
    *tones: str,
    mortar: str = "#c9c0b2",
    columns: int = 6,
    rows: int = 16,
    rough: float = 1.0,
    metres: float = 2.0,
    seed: int = 0,
) -> Material:
    """Bricks or squared stones in a running bond, each of one of the `tones`."""
    return Material(
        f"brick {tones} {mortar} {columns} {rows} {rough} {seed}",
        partial(_paint_brick, tones, mortar, columns, rows, rough, seed),
        metres,
    )


def _paint_planks(
    tone: str, gap: str, columns: int, rows: int, contrast: float, seed: int
) -> Image:
    rng = np.random.default_rng(seed)
    x, y, cell = cells(columns, rows, 0.37)
    grain = noise(seed + 1, 1.1, stretch=14.0)
    board = rng.uniform(1 - contrast, 1 + contrast, columns * rows)[cell]
    shift = rng.integers(SIDE, size=columns * rows)[cell]
    lines = grain[(np.arange(SIDE)[:, None] + shift) % SIDE, np.arange(SIDE)[None, :]]
    wood = shaded(np.broadcast_to(colour(tone), (SIDE, SIDE, 3)), board * (1 + 0.10 * lines))
    inside = in_cell(x, y, 0.012 * columns, 0.045)
    return blend(np.broadcast_to(colour(gap), (SIDE, SIDE, 3)), wood, inside)


def planks(
    tone: str,
    gap: str = "#20140c",
    columns: int = 2,
    rows: int = 12,
    contrast: float = 0.16,
    metres: float = 2.0,
    seed: int = 0,
) -> Material:
    """Boards with a grain; few rows and columns make panels and furniture."""
    return Material(
        f"planks {tone} {gap} {columns} {rows} {contrast} {seed}",
        partial(_paint_planks, tone, gap, columns, rows, contrast, seed),
        metres,
    )


def wood(tone: str, metres: float = 1.0, seed: int = 0) -> Material:
    """Furniture: one broad board."""
    return planks(tone, tone, 1, 1, 0.02, metres, seed)


def _paint_tiles(
    tones: tuple[str, ...], joint: str, count: int, width: float, gloss: float, seed: int
) -> Image:
    rng = np.random.default_rng(seed)
    x, y, cell = cells(count, count, 0.0)
    column, row = cell % count, cell // count
    palette = np.array([colour(tone) for tone in tones])
    pick = palette[(column + row) % len(tones)] * rng.uniform(0.95, 1.04, (count * count, 1))[cell]
    sheen = 1 + gloss * (0.5 - (x + y) / 2) + 0.02 * noise(seed, 1.4)
    return blend(
        np.broadcast_to(colour(joint), (SIDE, SIDE, 3)),
        shaded(pick, sheen),
        in_cell(x, y, width, width),
    )


def tiles(
    *tones: str,
    joint: str = "#8d8d8d",
    count: int = 4,
    width: float = 0.04,
    gloss: float = 0.08,
    metres: float = 2.0,
    seed: int = 0,
) -> Material:
    """Square tiles; several tones alternate."""
    return Material(
        f"tiles {tones} {joint} {count} {width} {gloss} {seed}",
        partial(_paint_tiles, tones, joint, count, width, gloss, seed),
        metres,
    )


def _paint_rubble(tones: tuple[str, ...], mortar: str, stones: int, seed: int) -> Image:
    """Voronoi cells around jittered points, tileable."""
    rng = np.random.default_rng(seed)
    place = (np.stack(np.divmod(np.arange(stones**2), stones), -1) + 0.5) / stones
    place = (place + rng.uniform(-0.42, 0.42, place.shape) / stones) % 1.0
    x, y = grid()
    first = np.full((SIDE, SIDE), np.inf)
    second = np.full((SIDE, SIDE), np.inf)
    owner = np.zeros((SIDE, SIDE), np.int64)
    for k, (px, py) in enumerate(place):
        dx = (x - px + 0.5) % 1.0 - 0.5
        dy = ((y - py + 0.5) % 1.0 - 0.5) * 1.35  # stones lie flat
        distance = np.hypot(dx, dy)
        nearer = distance < first
        second = np.where(nearer, first, np.minimum(second, distance))
        owner = np.where(nearer, k, owner)
        first = np.where(nearer, distance, first)
    inside = np.clip((second - first) * stones * 5 - 0.4, 0, 1)
    palette = np.array([colour(tone) for tone in tones])
    pick = palette[rng.integers(len(tones), size=len(place))]
    pick = pick * rng.uniform(0.75, 1.15, (len(place), 1))
    rock = shaded(pick[owner], 1 + 0.12 * noise(seed + 1, 0.9) + 0.10 * (inside - 0.6))
    return blend(np.broadcast_to(colour(mortar), (SIDE, SIDE, 3)), rock, inside)


def rubble(
    *tones: str, mortar: str = "#b9b2a0", stones: int = 7, metres: float = 2.0, seed: int = 0
) -> Material:
    """A wall or a floor of natural stones."""
    return Material(
        f"rubble {tones} {mortar} {stones} {seed}",
        partial(_paint_rubble, tones, mortar, stones, seed),
        metres,
    )
