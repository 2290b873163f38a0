"""Surfaces painted by code: tileable pictures from a few parameters and a seed.

Every function returns a ``Material``: how a surface looks and how many metres one repeat of its
picture spans.  ``mip_chain`` turns the picture into the words that the renderer reads.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from sim.indoor.mesh import Words

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


def _noise(seed: int, roughness: float = 1.6, stretch: float = 1.0) -> Map:
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


def _grid() -> tuple[Map, Map]:
    """Column and row of every texel centre in 0..1."""
    line = (np.arange(SIDE) + 0.5) / SIDE
    return np.broadcast_to(line[None, :], (SIDE, SIDE)), np.broadcast_to(
        line[:, None], (SIDE, SIDE)
    )


def _cells(columns: int, rows: int, shift: float) -> tuple[Map, Map, npt.NDArray[np.int64]]:
    """A brick bond: place inside the cell (0..1, 0..1) and number of the cell."""
    x, y = _grid()
    row = np.floor(y * rows)
    along = x * columns + (row * shift) % 1.0
    column = np.floor(along) % columns
    return along % 1.0, (y * rows) % 1.0, (row * columns + column).astype(np.int64)


def _joint(x: Map, y: Map, width_x: float, width_y: float) -> Map:
    """0 in the joint between cells, 1 inside them, soft by a texel or two."""
    edge_x = np.minimum(x, 1 - x) / width_x
    edge_y = np.minimum(y, 1 - y) / width_y
    return np.clip(np.minimum(edge_x, edge_y) * 1.5 - 0.5, 0, 1)


def _blend(low: Image, high: Image, share: Map) -> Image:
    return low + (high - low) * share[..., None]


def _shaded(base: Image, light: Map) -> Image:
    return np.clip(base * light[..., None], 0, 1)


# --- materials ------------------------------------------------------------------------------------


def _paint_plain(tone: str) -> Image:
    return np.broadcast_to(colour(tone), (1, 1, 3)).copy()


def plain(tone: str, glow: float = 0.0) -> Material:
    """One colour."""
    return Material(f"plain {tone} {glow}", partial(_paint_plain, tone), 1.0, glow)


def _paint_plaster(tone: str, grain: float, seed: int) -> Image:
    mottle = 1 + grain * (0.6 * _noise(seed, 1.8) + 0.5 * _noise(seed + 1, 0.5))
    return _shaded(np.broadcast_to(colour(tone), (SIDE, SIDE, 3)), mottle)


def plaster(tone: str, grain: float = 0.04, metres: float = 3.0, seed: int = 0) -> Material:
    """A painted wall, concrete or carpet: one colour, mottled."""
    return Material(
        f"plaster {tone} {grain} {seed}", partial(_paint_plaster, tone, grain, seed), metres
    )


def _paint_brick(
    tones: tuple[str, ...], mortar: str, columns: int, rows: int, rough: float, seed: int
) -> Image:
    rng = np.random.default_rng(seed)
    x, y, cell = _cells(columns, rows, 0.5)
    palette = np.array([colour(tone) for tone in tones])
    pick = palette[rng.integers(len(tones), size=columns * rows)]
    pick = pick * rng.uniform(0.82, 1.12, (columns * rows, 1))
    wobble = rough * 0.02 * _noise(seed + 7, 1.2)
    inside = _joint(
        np.clip(x + wobble, 0, 1), np.clip(y + wobble, 0, 1), 0.10 * columns / rows, 0.10
    )
    bevel = 1 + 0.10 * np.clip(0.3 - y, 0, 1) - 0.35 * np.clip(y - 0.75, 0, 1)
    stone = _shaded(pick[cell], bevel * (1 + 0.10 * rough * _noise(seed + 3, 1.0)))
    bed = _shaded(
        np.broadcast_to(colour(mortar), (SIDE, SIDE, 3)), 1 + 0.06 * _noise(seed + 5, 0.6)
    )
    return _blend(bed, stone, inside)


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
    x, y, cell = _cells(columns, rows, 0.37)
    grain = _noise(seed + 1, 1.1, stretch=14.0)
    board = rng.uniform(1 - contrast, 1 + contrast, columns * rows)[cell]
    shift = rng.integers(SIDE, size=columns * rows)[cell]
    lines = grain[(np.arange(SIDE)[:, None] + shift) % SIDE, np.arange(SIDE)[None, :]]
    wood = _shaded(np.broadcast_to(colour(tone), (SIDE, SIDE, 3)), board * (1 + 0.10 * lines))
    inside = _joint(x, y, 0.012 * columns, 0.045)
    return _blend(np.broadcast_to(colour(gap), (SIDE, SIDE, 3)), wood, inside)


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
    x, y, cell = _cells(count, count, 0.0)
    column, row = cell % count, cell // count
    palette = np.array([colour(tone) for tone in tones])
    pick = palette[(column + row) % len(tones)] * rng.uniform(0.95, 1.04, (count * count, 1))[cell]
    sheen = 1 + gloss * (0.5 - (x + y) / 2) + 0.02 * _noise(seed, 1.4)
    return _blend(
        np.broadcast_to(colour(joint), (SIDE, SIDE, 3)),
        _shaded(pick, sheen),
        _joint(x, y, width, width),
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
    x, y = _grid()
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
    rock = _shaded(pick[owner], 1 + 0.12 * _noise(seed + 1, 0.9) + 0.10 * (inside - 0.6))
    return _blend(np.broadcast_to(colour(mortar), (SIDE, SIDE, 3)), rock, inside)


def rubble(
    *tones: str, mortar: str = "#b9b2a0", stones: int = 7, metres: float = 2.0, seed: int = 0
) -> Material:
    """A wall or a floor of natural stones."""
    return Material(
        f"rubble {tones} {mortar} {stones} {seed}",
        partial(_paint_rubble, tones, mortar, stones, seed),
        metres,
    )


def _paint_diamonds(ground: str, tones: tuple[str, ...], count: int) -> Image:
    x, y = _grid()
    u, v = x * count, y * count * 2
    column, row = np.floor(u), np.floor(v)
    reach = np.abs(u - column - 0.5) * 2 + np.abs(v - row - 0.5) * 2
    palette = np.array([colour(tone) for tone in tones])
    lozenge = palette[((column + row) % len(tones)).astype(np.int64)]
    image = _blend(
        lozenge, np.broadcast_to(colour(ground), (SIDE, SIDE, 3)), np.clip(reach * 6 - 5, 0, 1)
    )
    return _blend(
        np.broadcast_to(colour(ground) * 0.6, (SIDE, SIDE, 3)), image, np.clip(reach * 9, 0, 1)
    )


def diamonds(ground: str, *tones: str, count: int = 6, metres: float = 2.0) -> Material:
    """Wallpaper with rows of lozenges."""
    return Material(
        f"diamonds {ground} {tones} {count}", partial(_paint_diamonds, ground, tones, count), metres
    )


def _paint_rings(ground: str, tones: tuple[str, ...], count: int) -> Image:
    x, y = _grid()
    u, v = (x * count) % 1.0 - 0.5, (y * count) % 1.0 - 0.5
    radius, angle = np.hypot(u, v), np.arctan2(v, u)
    petals = radius * (1 + 0.22 * np.cos(8 * angle))
    image = np.broadcast_to(colour(ground), (SIDE, SIDE, 3))
    for k, tone in enumerate(tones):
        edge = 0.44 * (1 - k / len(tones))
        image = _blend(
            image,
            np.broadcast_to(colour(tone), (SIDE, SIDE, 3)),
            np.clip((edge - petals) * 40 + 0.5, 0, 1),
        )
    return image


def rings(ground: str, *tones: str, count: int = 4, metres: float = 2.0) -> Material:
    """Wallpaper or tiles with a flower in each field."""
    return Material(
        f"rings {ground} {tones} {count}", partial(_paint_rings, ground, tones, count), metres
    )


def _paint_stripes(tones: tuple[str, ...], count: int, slant: int) -> Image:
    x, y = _grid()
    band = np.floor((x * count + y * slant) % 1.0 * len(tones)).astype(np.int64)
    return np.array([colour(tone) for tone in tones])[band % len(tones)]


def stripes(*tones: str, count: int = 4, slant: int = 0, metres: float = 2.0) -> Material:
    """Vertical or slanting stripes of equal width."""
    return Material(
        f"stripes {tones} {count} {slant}", partial(_paint_stripes, tones, count, slant), metres
    )


def _paint_canvas(tones: tuple[str, ...], seed: int) -> Image:
    rng = np.random.default_rng(seed)
    x, y = _grid()
    image = np.broadcast_to(colour(tones[0]), (SIDE, SIDE, 3))
    for _ in range(14):
        cx, cy, w, h = rng.uniform(0, 1), rng.uniform(0, 1), *rng.uniform(0.05, 0.3, 2)
        turn = rng.uniform(0, np.pi)
        u = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn)
        v = (y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)
        shape = (
            np.hypot(u / w, v / h)
            if rng.random() < 0.5
            else np.maximum(np.abs(u / w), np.abs(v / h))
        )
        tone = colour(tones[rng.integers(1, len(tones))]) * rng.uniform(0.8, 1.2)
        image = _blend(
            image,
            np.broadcast_to(np.clip(tone, 0, 1), (SIDE, SIDE, 3)),
            np.clip((1 - shape) * 20, 0, 1),
        )
    border = np.clip(np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y)) * 60 - 2, 0, 1)
    return _blend(np.broadcast_to(colour("#f3efe4"), (SIDE, SIDE, 3)), image, border)


def artwork(*tones: str, seed: int = 0, metres: float = 1.0) -> Material:
    """An abstract painting in a white mount."""
    return Material(f"artwork {tones} {seed}", partial(_paint_canvas, tones, seed), metres)


def _paint_books(seed: int) -> Image:
    rng = np.random.default_rng(seed)
    image = np.empty((SIDE, SIDE, 3))
    image[:] = colour("#1d140d")
    at = 0
    while at < SIDE:
        width = int(rng.integers(6, 16))
        top = int(rng.integers(0, 60))
        tone = rng.uniform(0.15, 0.85, 3) * rng.uniform(0.5, 1.0)
        image[top:, at : at + width - 1] = tone
        image[top + 30 : top + 40, at : at + width - 1] = np.clip(tone * 1.6 + 0.1, 0, 1)
        at += width
    return image


def books(seed: int = 0, metres: float = 1.0) -> Material:
    """A row of spines."""
    return Material(f"books {seed}", partial(_paint_books, seed), metres)


def _paint_panels(tone: str, line: str, lamp: str, count: int, seed: int) -> Image:
    rng = np.random.default_rng(seed)
    x, y, cell = _cells(count, count * 2, 0.5)
    shade = rng.uniform(0.75, 1.15, 2 * count * count)[cell]
    image = _shaded(np.broadcast_to(colour(tone), (SIDE, SIDE, 3)), shade * (1.08 - 0.16 * y))
    image = _blend(np.broadcast_to(colour(line), (SIDE, SIDE, 3)), image, _joint(x, y, 0.03, 0.05))
    lit = (rng.random(2 * count * count) < 0.3)[cell]
    slot = lit & (np.abs(y - 0.5) < 0.09) & (x > 0.15) & (x < 0.75)
    return np.where(slot[..., None], colour(lamp), image)


def panels(
    tone: str, line: str, lamp: str, count: int = 3, metres: float = 2.4, seed: int = 0
) -> Material:
    """Technical wall: plates with lit slots."""
    return Material(
        f"panels {tone} {line} {lamp} {count} {seed}",
        partial(_paint_panels, tone, line, lamp, count, seed),
        metres,
    )


def _paint_leaves(tone: str, seed: int) -> Image:
    patch = _noise(seed, 1.0)
    return _shaded(
        np.broadcast_to(colour(tone), (SIDE, SIDE, 3)),
        0.85 + 0.5 * (patch > 0.2) - 0.35 * (patch < -0.5) + 0.1 * _noise(seed + 1, 0.6),
    )


def leaves(tone: str = "#3f7f32", seed: int = 0, metres: float = 0.8) -> Material:
    """Foliage."""
    return Material(f"leaves {tone} {seed}", partial(_paint_leaves, tone, seed), metres)
