"""Bytes to messages and back: framing, checksum, signing, and the hot messages packed by hand.

Interface: :class:`Codec` (one per end of a link) with ``encode`` and ``decode``, :class:`Splitter`
for byte streams.  SET_POSITION_TARGET_LOCAL_NED, LOCAL_POSITION_NED and ATTITUDE are packed here
(a quarter of pymavlink's time); everything else goes through pymavlink's classes.  Nothing that
arrives raises: what is not a whole, valid, fresh message of a known kind is dropped and counted.

Sources: https://mavlink.io/en/guide/serialization.html, .../message_signing.html
"""

import hashlib
import hmac
import struct
import time
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from fastcrc.crc16 import mcrf4xx

from sim.vehicle.dialect import Message, mavlink

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
SIGNED = 0x01
SIGNATURE = 13  # bytes
LONGEST = 10 + 255 + 2 + SIGNATURE
EPOCH = 1_420_070_400  # s, 2015-01-01, where signing timestamps begin
STALE = 60 * 100_000  # 10 us; a new stream may lag by a minute


class SetPointMessage(NamedTuple):
    """SET_POSITION_TARGET_LOCAL_NED, fields in the order of the wire."""

    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    afx: float
    afy: float
    afz: float
    yaw: float
    yaw_rate: float
    type_mask: int
    target_system: int
    target_component: int
    coordinate_frame: int


class LocalPosition(NamedTuple):
    """LOCAL_POSITION_NED."""

    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


class Attitude(NamedTuple):
    """ATTITUDE."""

    time_boot_ms: int
    roll: float
    pitch: float
    yaw: float
    rollspeed: float
    pitchspeed: float
    yawspeed: float


class _Hot(NamedTuple):
    """How one of these travels."""

    kind: type[SetPointMessage] | type[LocalPosition] | type[Attitude]
    id: int
    crc_extra: int
    layout: struct.Struct


_HOT = (
    _Hot(SetPointMessage, 84, 143, struct.Struct("<IfffffffffffHBBB")),
    _Hot(LocalPosition, 32, 185, struct.Struct("<Iffffff")),
    _Hot(Attitude, 30, 39, struct.Struct("<Iffffff")),
)
_BY_ID = {hot.id: hot for hot in _HOT}
_BY_KIND: dict[type, _Hot] = {hot.kind: hot for hot in _HOT}
_HEADER = struct.Struct("<BBBBBBBHB")


class Signing:
    """One end's signing state: 32 secret bytes, our clock, the clocks of the streams we heard."""

    def __init__(self, key: bytes, link: int = 0) -> None:
        if len(key) != 32:
            raise ValueError(f"a signing key has 32 bytes, this one {len(key)}")
        self._key = key
        self._link = link
        self._clock = int((time.time() - EPOCH) * 100_000)
        self._heard: dict[tuple[int, int, int], int] = {}

    def sign(self, frame: bytes) -> bytes:
        """The 13 bytes that follow a frame."""
        self._clock = max(self._clock + 1, int((time.time() - EPOCH) * 100_000))
        head = struct.pack("<BQ", self._link, self._clock)[:7]
        return head + self._digest(frame + head)

    def accepts(self, frame: bytes, system: int, component: int) -> bool:
        """Whether a signed frame is genuine and newer than its stream's last one."""
        if not hmac.compare_digest(self._digest(frame[:-6]), frame[-6:]):
            return False
        link = frame[-13]
        stamp = int.from_bytes(frame[-12:-6], "little")
        stream = (link, system, component)
        if stamp <= self._heard.get(stream, self._clock - STALE):
            return False
        self._heard[stream] = stamp
        self._clock = max(self._clock, stamp)
        return True

    def _digest(self, data: bytes) -> bytes:
        return hashlib.sha256(self._key + data).digest()[:6]


class Codec:
    """One end of a link: an identity, a sequence number, and perhaps a signing key."""

    def __init__(self, system: int, component: int, key: bytes | None = None) -> None:
        self.system, self.component = system, component
        self.signing = Signing(key) if key is not None else None
        self.dropped: Counter[str] = Counter()  # cause -> frames
        self._sequence = 0
        self._parser = mavlink.MAVLink(None)

    def encode(self, message: Message) -> bytes:
        """The frame of a message; takes the next sequence number."""
        hot = _BY_KIND.get(type(message))
        if hot is not None:
            payload, id_, crc_extra = hot.layout.pack(*message), hot.id, hot.crc_extra
        else:
            kind = type(message)  # STATUSTEXT and BATTERY_STATUS have a field named id
            payload, id_, crc_extra = self._payload(message), kind.id, kind.crc_extra
        payload = payload.rstrip(b"\0") or b"\0"
        flags = 0 if self.signing is None else SIGNED
        head = _HEADER.pack(
            MAGIC_2, len(payload), flags, 0, self._sequence, self.system, self.component,
            id_ & 0xFFFF, id_ >> 16,
        )  # fmt: skip
        self._sequence = (self._sequence + 1) & 0xFF
        body = head + payload
        crc = mcrf4xx(body[1:] + bytes((crc_extra,)), 0xFFFF)
        frame = body + crc.to_bytes(2, "little")
        return frame if self.signing is None else frame + self.signing.sign(frame)

    @staticmethod
    def _payload(message: Message) -> bytes:
        values: list[float | int | bytes] = []
        for name, count in zip(message.ordered_fieldnames, message.array_lengths, strict=True):
            value = getattr(message, f"_{name}_raw", getattr(message, name))
            if isinstance(value, str):
                value = value.encode()
            if count and not isinstance(value, bytes):
                values.extend(value)
            else:
                values.append(value)
        packed: bytes = message.unpacker.pack(*values)
        return packed

    def decode(self, frame: bytes) -> Message | None:
        """The message of one whole frame, or None if it must not be used."""
        version_2 = frame[0] == MAGIC_2
        start = 10 if version_2 else 6
        signed = version_2 and bool(frame[2] & SIGNED)
        if version_2 and frame[2] & ~SIGNED:
            self._refuse("flags")
            return None
        end = len(frame) - (SIGNATURE if signed else 0) - 2
        if end - start != frame[1]:
            self._refuse("length")
            return None
        if version_2:
            system, component = frame[5], frame[6]
            id_ = int.from_bytes(frame[7:10], "little")
        else:
            system, component, id_ = frame[3], frame[4], frame[5]
        kind = mavlink.mavlink_map.get(id_)
        if kind is None:
            self._refuse("unknown")
            return None
        crc = mcrf4xx(frame[1:end] + bytes((kind.crc_extra,)), 0xFFFF)
        if crc != int.from_bytes(frame[end : end + 2], "little"):
            self._refuse("checksum")
            return None
        if self.signing is not None and not (
            signed and self.signing.accepts(frame, system, component)
        ):
            self._refuse("signature")
            return None
        hot = _BY_ID.get(id_)
        if hot is not None:
            size = hot.layout.size
            payload = frame[start:end][:size].ljust(size, b"\0")
            return hot.kind(*hot.layout.unpack(payload))
        try:
            return self._parser.decode(bytearray(frame))
        except mavlink.MAVError:
            self._refuse("payload")
            return None

    def decode_all(self, data: bytes) -> list[Message]:
        """The messages of a datagram."""
        return [m for frame in Splitter().feed(data) if (m := self.decode(frame)) is not None]

    def _refuse(self, cause: str) -> None:
        self.dropped[cause] += 1


class Splitter:
    """Cuts a stream of bytes into frames; what is between them is skipped."""

    def __init__(self) -> None:
        self._waiting = b""

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The frames that these bytes complete."""
        buffer = self._waiting + data if self._waiting else data
        at, size = 0, len(buffer)
        while at < size:
            magic = buffer[at]
            if magic not in {MAGIC_1, MAGIC_2}:
                at += 1
                continue
            if size - at < 3:
                break
            length = buffer[at + 1] + (8 if magic == MAGIC_1 else 12)
            if magic == MAGIC_2 and buffer[at + 2] & SIGNED:
                length += SIGNATURE
            if size - at < length:
                break
            yield buffer[at : at + length]
            at += length
        self._waiting = buffer[at:][-LONGEST:]
