"""Parameters on the wire: a typed header beside one flat buffer.

The header is a small MessagePack map in Zenoh's attachment, the body the encoded vector
(:mod:`swarm.mixing.compression`).  A receiver checks, in this order and before it reads a number:
size of the header, its types and fields, protocol version, fingerprint of the layout, round,
length; and finiteness after decoding.  Nothing received is unpickled, evaluated or trusted to name
a path.
"""

import hashlib
import math
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarm.errors import PayloadError
from swarm.mixing.compression import Codec, FloatType
from swarm.protocol.messages import LARGEST, PROTOCOL, ParameterHeader
from swarm.wire.buffers import Body

HEADER_LIMIT = 16384  # [bytes] a complete graph of some 200 agents

Vector = NDArray[np.floating]
Precision = Literal["float32", "float64"]


@dataclass(frozen=True)
class Layout:
    """What one flat parameter vector means.

    Attributes:
        swarm: name of the swarm that agreed on it.
        parts: name and shape of each tensor, in order.
        precision: floating-point type of the vector in memory and on the wire.
        copies: vectors per message (a mixing rule may send more than theta).
        codec: name of the body's encoding.
        agreed: everything else that two agents must have in common, as (key, value).
    """

    swarm: str
    parts: tuple[tuple[str, tuple[int, ...]], ...]
    precision: Precision = "float32"
    copies: int = 1
    codec: str = "none"
    agreed: tuple[tuple[str, str], ...] = ()

    @cached_property
    def size(self) -> int:
        """Number of parameters."""
        return sum(prod(shape) for _, shape in self.parts)

    @property
    def dtype(self) -> FloatType:
        """NumPy type of the vector."""
        return np.dtype(np.float32 if self.precision == "float32" else np.float64)

    @cached_property
    def fingerprint(self) -> str:
        """Sixteen hexadecimal digits that two agents share only if they mean the same."""
        vectors = (self.swarm, self.parts, self.precision, self.copies, self.codec)
        return _digits((PROTOCOL, *vectors, self.agreed))

    @cached_property
    def shape(self) -> str:
        """Likewise of the parameters alone, for what is kept on disk."""
        return _digits((self.swarm, self.parts, self.precision))


def plain(layout: Layout) -> Layout:
    """The layout of parameters that are handed over, where messages have ``layout``."""
    return replace(layout, copies=1, codec="none")


@dataclass(frozen=True, slots=True)
class Message:
    """A header and the vector that came with it, both checked."""

    header: ParameterHeader
    vector: Vector


def _digits(meaning: object) -> str:
    return hashlib.blake2b(repr(meaning).encode(), digest_size=8).hexdigest()


_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(ParameterHeader)


def encode_header(header: ParameterHeader) -> bytes:
    """The attachment of a message."""
    return _encoder.encode(header)


def decode_header(
    attachment: bytes | None, layout: Layout, last: float = math.inf, most: float = math.inf
) -> ParameterHeader:
    """Read a header and check it against one's own layout.

    Args:
        attachment: as received.
        layout: own layout.
        last: number of the last round, where rounds are common.
        most: what an agent can have learned [rounds], where they are not.

    Raises:
        PayloadError: with the first cause found: ``header``, ``version``, ``fingerprint`` or
            ``round``.
    """
    if attachment is None or not 0 < len(attachment) <= HEADER_LIMIT:
        length = 0 if attachment is None else len(attachment)
        raise PayloadError(
            "header", f"header of {length} bytes: expected 1 to {HEADER_LIMIT} bytes"
        )
    try:
        header = _decoder.decode(attachment)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise PayloadError("header", f"header does not read: {error}") from None
    if header.version != PROTOCOL:
        raise PayloadError("version", f"protocol {header.version}: expected {PROTOCOL}")
    if header.fingerprint != layout.fingerprint:
        raise PayloadError(
            "fingerprint",
            f"parameters of another layout, fingerprint {header.fingerprint!r}: "
            f"expected {layout.fingerprint!r}",
        )
    if not 0 <= header.round <= min(last, LARGEST):
        window = f"0 to {last}" if last < math.inf else "0 or more"
        raise PayloadError("round", f"round {header.round}: expected {window}")
    if header.learned > most:
        raise PayloadError("round", f"learned {header.learned} rounds: expected at most {most}")
    return header


def decode_body(body: Body, layout: Layout, codec: Codec, longest: float = math.inf) -> Vector:
    """Read the vector that came with a good header.

    Args:
        body: as received.
        layout: own layout.
        codec: its encoding.
        longest: largest Euclidean norm of an honest sender's vector.

    Raises:
        PayloadError: cause ``length``, ``finite`` or ``norm``.
    """
    vector = codec.decode(body, layout.size * layout.copies, layout.dtype)
    check_norm(vector, longest)
    return vector


def check_norm(vector: Vector, longest: float) -> None:
    """No honest neighbour is further out than ``longest``; a poisoner stays within, if at all.

    Raises:
        PayloadError: cause ``finite`` or ``norm``.
    """
    norm = _norm(vector)
    if norm > longest:
        raise PayloadError("norm", f"parameters of norm {norm:.3g}: expected at most {longest:.3g}")


def _norm(vector: Vector) -> float:
    """Norm of a vector that is finite: large vectors are read once for both."""
    with np.errstate(over="ignore"):  # a large sum of squares only asks for a closer look
        square = float(np.dot(vector, vector))
    if math.isfinite(square):
        return math.sqrt(square)
    if not np.isfinite(vector).all():
        raise PayloadError("finite", "parameters are not finite")
    return float(np.linalg.norm(vector.astype(np.float64)))
