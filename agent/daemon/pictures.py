"""Small pictures for those who watch: PNG (RFC 2083) without a picture library.

Interface: :func:`png_of_rgb` and :func:`png_of_depth`.  A companion computer encodes a few pictures
a second; a 103 x 103 one takes about a millisecond.
"""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

MAGIC = b"\x89PNG\r\n\x1a\n"
GREY, RGB = 0, 2  # colour types
EFFORT = 1  # of zlib: a third larger than the best, six times faster
FAR = 65_535  # [mm] deepest that 16 bits hold; what is farther, or nothing, looks like this


def png_of_rgb(picture: NDArray[np.uint8]) -> bytes:
    """A PNG of ``picture`` (H, W, 3)."""
    return _png(np.ascontiguousarray(picture, np.uint8), RGB, bits=8)


def png_of_depth(depth: NDArray[np.floating]) -> bytes:
    """A PNG of ``depth`` (H, W) [m]: one channel of 16 bits, in millimetres."""
    millimetres = np.nan_to_num(depth * 1e3, nan=FAR, posinf=FAR, neginf=0).clip(0, FAR)
    return _png(millimetres.astype(">u2"), GREY, bits=16)


def _png(pixels: NDArray[np.generic], colour: int, bits: int) -> bytes:
    height, width = pixels.shape[:2]
    rows = np.frombuffer(pixels.tobytes(), np.uint8).reshape(height, -1)
    each = rows.shape[1] // width
    left = np.zeros_like(rows)
    left[:, each:] = rows[:, :-each]
    filtered = np.concatenate([np.full((height, 1), 1, np.uint8), rows - left], axis=1)
    header = struct.pack(">2I5B", width, height, bits, colour, 0, 0, 0)
    body = zlib.compress(filtered.tobytes(), EFFORT)
    return MAGIC + _chunk(b"IHDR", header) + _chunk(b"IDAT", body) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
