"""What two ends of a link say to each other: the small typed part of every put (its attachment).

A link carries a stream of messages from one agent to another.  A message is a header and a body
(:mod:`swarm.wire.stream` says how it is cut); each takes ``1 + len(body)`` places of the stream,
the first for its header, so that a message without a body has a place, too.  Frames are MessagePack
arrays; one that does not read, or names another sender than its key, is refused.
"""

from typing import Annotated

import msgspec

from swarm.errors import PayloadError

LONGEST_FRAME = 65_536  # [bytes] with the header in it
Place = Annotated[int, msgspec.Meta(ge=0)]
Seconds = Annotated[float, msgspec.Meta(ge=0)]  # refuses NaN too
Name = Annotated[str, msgspec.Meta(max_length=64)]


class Chunk(msgspec.Struct, frozen=True, array_like=True, tag="chunk", forbid_unknown_fields=True):
    """Part of a message; its bytes are the payload.

    Attributes:
        agent, life: of the sender.
        stream: number of the stream; a new one begins when the receiver has forgotten the old one.
        attempt: grows when the sender goes back in its stream.
        place: in the stream, of this part's first byte (or of the header).
        kind: of the message, for the protocol above.
        offset: of the part in the body [bytes].
        total: length of the body [bytes].
        wants: whether to acknowledge at once.
        sent: sender's clock [s].
        header: with the message's first part; else empty.
    """

    agent: Name
    life: Name
    stream: Place
    attempt: Place
    place: Place
    kind: Name
    offset: Place
    total: Place
    wants: bool
    sent: Seconds
    header: bytes


class Ack(msgspec.Struct, frozen=True, array_like=True, tag="ack", forbid_unknown_fields=True):
    """What has arrived.

    Attributes:
        agent, life: of the receiver, who says this.
        to: life of the sender whose stream it is.
        stream, attempt: as in the chunk that is answered.
        have: places of the stream that have arrived, in order.
        lost: whether something before the answered frame is missing.
        sent: as in the answered frame [s].
        rate: at which the message arrived that this part completes; else None [bytes/s].
        host: name of the receiver's machine, as far as shared memory goes; empty without.
        shared: whether the answered part came through shared memory.
    """

    agent: Name
    life: Name
    to: Name
    stream: Place
    attempt: Place
    have: Place
    lost: bool
    sent: Seconds
    rate: Seconds | None
    host: Name
    shared: bool


class Ask(msgspec.Struct, frozen=True, array_like=True, tag="ask", forbid_unknown_fields=True):
    """ "What do you have?", sent behind the chunks that it asks about; answered by an :class:`Ack`.

    Attributes:
        agent, life, stream, attempt: as in :class:`Chunk`.
        place: everything before it has been sent.
        sent: sender's clock [s].
    """

    agent: Name
    life: Name
    stream: Place
    attempt: Place
    place: Place
    sent: Seconds


class Note(msgspec.Struct, frozen=True, array_like=True, tag="note", forbid_unknown_fields=True):
    """A header by itself, outside the stream: it is not waited for and may be lost.

    Attributes:
        agent, life: of the sender.
        kind: of the message.
        header: the message.
    """

    agent: Name
    life: Name
    kind: Name
    header: bytes


Frame = Chunk | Ack | Ask | Note
_encoder = msgspec.msgpack.Encoder()
_decoder: msgspec.msgpack.Decoder[Frame] = msgspec.msgpack.Decoder(Frame)


def encode(frame: Frame) -> bytes:
    """The attachment that says it."""
    return _encoder.encode(frame)


def decode(raw: bytes, sender: str) -> Frame:
    """Read an attachment that came under ``sender``'s key.

    Raises:
        PayloadError: cause ``frame`` or ``key``.
    """
    if not 0 < len(raw) <= LONGEST_FRAME:
        raise PayloadError("frame", f"frame of {len(raw)} bytes: expected 1 to {LONGEST_FRAME}")
    try:
        frame = _decoder.decode(raw)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise PayloadError("frame", f"frame does not read: {error}") from None
    if frame.agent != sender:
        raise PayloadError("key", f'"{frame.agent}" speaks under the key of "{sender}"')
    return frame
