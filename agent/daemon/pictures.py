"""Small pictures for those who watch, as PNG.

Interface: :func:`png_of_rgb` and :func:`png_of_depth`.  A companion computer encodes a few pictures
a second; a 103 x 103 one takes about a millisecond.
"""

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

EFFORT = 1  # of the compression: a third larger than the best, six times faster
FAR = 65_535  # [mm] deepest that 16 bits hold; what is farther, or nothing, looks like this


def png_of_rgb(picture: NDArray[np.uint8]) -> bytes:
    """A PNG of ``picture`` (H, W, 3)."""
    return _png(np.asarray(picture, np.uint8))


def png_of_depth(depth: NDArray[np.floating]) -> bytes:
    """A PNG of ``depth`` (H, W) [m]: one channel of 16 bits, in millimetres."""
    millimetres = np.nan_to_num(depth * 1e3, nan=FAR, posinf=FAR, neginf=0).clip(0, FAR)
    return _png(millimetres.astype(np.uint16))


def _png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", compress_level=EFFORT)
    return file.getvalue()
