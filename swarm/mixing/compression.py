"""How a parameter vector becomes bytes: as it is, as halves, or as bytes with error feedback.

Lossy codecs remember what they could not say and add it to the next message (error feedback,
Seide 2014; CHOCO-SGD, Koloskova 2019).  Every message stands alone: a lost one does no harm to the
next.  The sender mixes with what the others will decode, not with what it meant, so that the mean
over the swarm is kept (:mod:`swarm.mixing.rules`).
"""

from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from swarm.errors import PayloadError
from swarm.wire.buffers import Body, bytes_of

Vector = NDArray[np.floating]
FloatType = np.dtype[np.floating]
Compression = Literal["none", "fp16", "int8"]
BLOCK = 64  # values that share one int8 scale: 6% more bytes than one scale for all


class Codec(Protocol):
    """Turns vectors into bytes and back; ``decode(encode(x))`` is what receivers see of x."""

    lossy: bool

    def encode(self, vector: Vector) -> Body:
        """Bytes of ``vector``, which must not change any more."""
        ...

    def decode(self, body: Body, size: int, dtype: FloatType) -> Vector:
        """Read ``size`` values into a new vector of type ``dtype``.

        Raises:
            PayloadError: cause ``length``.
        """
        ...


def _check_length(body: Body, expected: int) -> None:
    if len(body) != expected:
        raise PayloadError("length", f"{len(body)} bytes of parameters: expected {expected}")


class Plain:
    """The vector's own little-endian bytes."""

    lossy = False

    def encode(self, vector: Vector) -> Body:
        return bytes_of(vector)

    def decode(self, body: Body, size: int, dtype: FloatType) -> Vector:
        _check_length(body, size * dtype.itemsize)
        return np.frombuffer(body, dtype.newbyteorder("<"))


class Half:
    """IEEE half precision: 11 significant bits, magnitudes to 65504 (larger ones saturate)."""

    lossy = True

    def encode(self, vector: Vector) -> bytes:
        return np.clip(vector, -65504.0, 65504.0).astype("<f2").tobytes()

    def decode(self, body: Body, size: int, dtype: FloatType) -> Vector:
        _check_length(body, size * 2)
        return np.frombuffer(body, "<f2").astype(dtype)


class Int8:
    """Blocks of :data:`BLOCK` values: a float32 scale (largest magnitude / 127) and bytes."""

    lossy = True

    def encode(self, vector: Vector) -> bytes:
        blocks = np.zeros((-(-vector.size // BLOCK), BLOCK), np.float32)
        blocks.reshape(-1)[: vector.size] = vector
        scale = np.abs(blocks).max(axis=1, keepdims=True) / np.float32(127)
        levels = np.rint(blocks / np.where(scale > 0, scale, np.float32(1))).astype(np.int8)
        scales: bytes = scale.astype("<f4").tobytes()
        return scales + levels.reshape(-1)[: vector.size].tobytes()

    def decode(self, body: Body, size: int, dtype: FloatType) -> Vector:
        count = -(-size // BLOCK)
        _check_length(body, count * 4 + size)
        scale = np.repeat(np.frombuffer(body, "<f4", count), BLOCK)[:size]
        levels = np.frombuffer(body, np.int8, size, count * 4)
        return np.asarray(levels * scale, dtype)


CODECS: dict[Compression, type[Plain] | type[Half] | type[Int8]] = {
    "none": Plain,
    "fp16": Half,
    "int8": Int8,
}
