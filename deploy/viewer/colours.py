"""Colours that nobody confuses; an agent has the same one in every view.

The first six are of Okabe and Ito (2008), whom no colour blindness mixes up.  More agents get the
colours that are farthest from all before them, in OKLab (Ottosson 2020), where distances are what
people see.  No two agents of a swarm share one; names stand beside them where there is room.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]

FIRST: tuple[Colour, ...] = (
    (86, 180, 233),  # sky blue
    (230, 159, 0),  # orange
    (204, 121, 167),  # reddish purple
    (240, 228, 66),  # yellow
    (0, 114, 178),  # blue
    (220, 220, 220),  # light grey
)
GOAL: Colour = (0, 158, 115)  # bluish green
TROUBLE: Colour = (213, 94, 0)  # vermilion: obstacles, missing edges, warnings
FREE: Colour = (38, 42, 48)
START: Colour = (110, 116, 124)
LINES: Colour = (20, 22, 25)
ABSENT: Colour = (90, 90, 90)
TAKEN = (GOAL, TROUBLE, START, ABSENT, FREE)  # they mean something else
STEPS = 18  # values of each channel that are tried
CONES = np.array(  # from linear sRGB: long, medium, short
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
LAB = np.array(  # from their cube roots: lightness, green-red, blue-yellow
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
DARKEST = 0.5  # OKLab lightness; darker ones drown in the background


def of_agents(count: int) -> tuple[Colour, ...]:
    """Colours of so many agents, in the order of the swarm file."""
    return FIRST[:count] if count <= len(FIRST) else _farthest(count)


@lru_cache(maxsize=8)
def _farthest(count: int) -> tuple[Colour, ...]:
    """:data:`FIRST`, and then one after the other what is farthest from all that are taken."""
    channel = np.linspace(0, 255, STEPS).astype(int)
    tried = np.stack(np.meshgrid(channel, channel, channel), axis=-1).reshape(-1, 3)
    places = oklab(tried)
    bright = places[:, 0] >= DARKEST
    tried, places = tried[bright], places[bright]
    chosen = list(FIRST)
    taken = oklab(np.array([*FIRST, *TAKEN]))
    nearest = np.linalg.norm(places[:, None] - taken, axis=2).min(axis=1)
    while len(chosen) < count:
        best = int(nearest.argmax())
        red, green, blue = tried[best].tolist()
        chosen.append((red, green, blue))
        nearest = np.minimum(nearest, np.linalg.norm(places - places[best], axis=1))
    return tuple(chosen)


def oklab(colours: NDArray[np.integer]) -> NDArray[np.float64]:
    """(n, 3) lightness, green-red and blue-yellow of (n, 3) sRGB bytes."""
    channels = np.asarray(colours, np.float64) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    cones = np.cbrt(linear @ CONES.T)
    return np.asarray(cones @ LAB.T)
