"""The reward: how far away the nearest things ahead are (PEDRA's dynamic windowing).

PEDRA reads depth from an 8-bit picture in which 255 stands for 100 m, cuts it at 50 of these units
(19.6 m) and divides by 50.  On the map d of these numbers in 0..1:

    n = max(50 mean(d) / 3, 1)                          the more room, the narrower the window
    rows    h .. h + H/n,  h = floor(0.9 H (n-1)/2n)    slightly above the middle
    columns w .. w + W/n,  w = floor(W (n-1)/2n)
    reward = mean of the nearest 5% of d in the window

A reward under 0.07 (1.37 m) counts as a crash, as touching does, and is paid with -1.
Source: PEDRA's `avg_depth` and `reward_gen`, Anwar and Raychowdhury.  The 8 bits themselves (steps
of 0.39 m) are not imitated: depth stays exact.
"""

import numpy as np

from sim.indoor.compiled import compiled
from sim.indoor.geometry.mesh import Floats

UNITS = 50.0  # of PEDRA's 8-bit depth: the cut
FULL_SCALE = 50.0 * 100.0 / 255.0  # m; 19.6
CRASH_THRESHOLD = 0.07  # of the full scale; 1.37 m
CRASH_REWARD = -1.0
NEAREST = 0.05  # share of the window that counts
BINS = 256


@compiled
def window(mean: float, height: int, width: int) -> tuple[int, int, int, int]:
    """First row, last row + 1, first column, last column + 1, for the mean of the map."""
    n = max(mean * UNITS / 3.0, 1.0)
    top = int(0.9 * height * (n - 1.0) / (2.0 * n))
    left = int(width * (n - 1.0) / (2.0 * n))
    bottom = min(int(np.round(top + height / n)), height)
    right = min(int(np.round(left + width / n)), width)
    return top, max(bottom, top + 1), left, max(right, left + 1)


@compiled(fastmath={"reassoc", "contract", "nsz"})
def _mean(depth: Floats) -> float:
    """The mean of the normalised map."""
    total = 0.0
    full = np.float32(FULL_SCALE)
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            total += min(depth[row, column], full)
    return total / (depth.size * FULL_SCALE)


@compiled
def windowed(depth: Floats) -> float:
    """The reward of a depth map [m], 0..1, before a crash is judged."""
    top, bottom, left, right = window(_mean(depth), depth.shape[0], depth.shape[1])
    wanted = max(int(np.round(NEAREST * ((bottom - top) * (right - left)))), 1)
    # a histogram finds the bin in which the last of the nearest lies; only that bin is sorted
    counts = np.zeros(BINS + 1, np.int64)
    scale = BINS / FULL_SCALE
    for row in range(top, bottom):
        for column in range(left, right):
            counts[int(min(depth[row, column], FULL_SCALE) * scale)] += 1
    last, below = 0, 0
    while below + counts[last] < wanted:
        below += counts[last]
        last += 1
    border = np.empty(counts[last], np.float64)
    total, found = 0.0, 0
    for row in range(top, bottom):
        for column in range(left, right):
            metres = min(float(depth[row, column]), FULL_SCALE)
            b = int(metres * scale)
            if b < last:
                total += metres
            elif b == last:
                border[found] = metres
                found += 1
    border.sort()
    for k in range(wanted - below):
        total += border[k]
    return total / (wanted * FULL_SCALE)
