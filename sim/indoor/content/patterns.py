"""Decorated surfaces painted by code: wallpaper, paintings, books, machine panels, leaves."""

from functools import partial

import numpy as np

from sim.indoor.content.textures import (
    SIDE,
    Image,
    Material,
    blend,
    cells,
    colour,
    grid,
    in_cell,
    noise,
    shaded,
)


def _paint_diamonds(ground: str, tones: tuple[str, ...], count: int) -> Image:
    x, y = grid()
    u, v = x * count, y * count * 2
    column, row = np.floor(u), np.floor(v)
    reach = np.abs(u - column - 0.5) * 2 + np.abs(v - row - 0.5) * 2
    palette = np.array([colour(tone) for tone in tones])
    lozenge = palette[((column + row) % len(tones)).astype(np.int64)]
    image = blend(
        lozenge, np.broadcast_to(colour(ground), (SIDE, SIDE, 3)), np.clip(reach * 6 - 5, 0, 1)
    )
    return blend(
        np.broadcast_to(colour(ground) * 0.6, (SIDE, SIDE, 3)), image, np.clip(reach * 9, 0, 1)
    )


def diamonds(ground: str, *tones: str, count: int = 6, metres: float = 2.0) -> Material:
    """Wallpaper with rows of lozenges."""
    return Material(
        f"diamonds {ground} {tones} {count}", partial(_paint_diamonds, ground, tones, count), metres
    )


def _paint_rings(ground: str, tones: tuple[str, ...], count: int) -> Image:
    x, y = grid()
    u, v = (x * count) % 1.0 - 0.5, (y * count) % 1.0 - 0.5
    radius, angle = np.hypot(u, v), np.arctan2(v, u)
    petals = radius * (1 + 0.22 * np.cos(8 * angle))
    image = np.broadcast_to(colour(ground), (SIDE, SIDE, 3))
    for k, tone in enumerate(tones):
        edge = 0.44 * (1 - k / len(tones))
        image = blend(
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
    x, y = grid()
    band = np.floor((x * count + y * slant) % 1.0 * len(tones)).astype(np.int64)
    return np.array([colour(tone) for tone in tones])[band % len(tones)]


def stripes(*tones: str, count: int = 4, slant: int = 0, metres: float = 2.0) -> Material:
    """Vertical or slanting stripes of equal width."""
    return Material(
        f"stripes {tones} {count} {slant}", partial(_paint_stripes, tones, count, slant), metres
    )


def _paint_canvas(tones: tuple[str, ...], seed: int) -> Image:
    rng = np.random.default_rng(seed)
    x, y = grid()
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
        image = blend(
            image,
            np.broadcast_to(np.clip(tone, 0, 1), (SIDE, SIDE, 3)),
            np.clip((1 - shape) * 20, 0, 1),
        )
    border = np.clip(np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y)) * 60 - 2, 0, 1)
    return blend(np.broadcast_to(colour("#f3efe4"), (SIDE, SIDE, 3)), image, border)


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
    x, y, cell = cells(count, count * 2, 0.5)
    shade = rng.uniform(0.75, 1.15, 2 * count * count)[cell]
    image = shaded(np.broadcast_to(colour(tone), (SIDE, SIDE, 3)), shade * (1.08 - 0.16 * y))
    image = blend(np.broadcast_to(colour(line), (SIDE, SIDE, 3)), image, in_cell(x, y, 0.03, 0.05))
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
    patch = noise(seed, 1.0)
    return shaded(
        np.broadcast_to(colour(tone), (SIDE, SIDE, 3)),
        0.85 + 0.5 * (patch > 0.2) - 0.35 * (patch < -0.5) + 0.1 * noise(seed + 1, 0.6),
    )


def leaves(tone: str = "#3f7f32", seed: int = 0, metres: float = 0.8) -> Material:
    """Foliage."""
    return Material(f"leaves {tone} {seed}", partial(_paint_leaves, tone, seed), metres)
