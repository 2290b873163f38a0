"""One connection to one vehicle: frames out, messages in, and the tape that records both.

Interface: :class:`Link`.  Not for several threads; ``vehicle`` has one that owns it.
"""

import struct
import time
from collections.abc import Iterator
from typing import Any, Protocol

from agent.vehicle.connection import open_connection
from agent.vehicle.dialects import mavlink

COMPANION = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER  # 191
AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
SIGNED = mavlink.MAVLINK_IFLAG_SIGNED
SIGNING_EPOCH = 1_420_070_400  # s, 2015-01-01

Message = Any


class Tape(Protocol):
    """Takes bytes, and holds nobody up."""

    def write(self, record: bytes, /) -> object:
        """Keep them."""
        ...


class Link:
    """A connection and pymavlink's codec.

    Args:
        text: see ``connection``.
        timeout: for opening it [s].
        system: id of the vehicle, ours too; 0: of whichever autopilot is heard first.
        key: 32 bytes; sign, and believe only what is signed.
        record: every frame, ours too, goes here as a .tlog.

    Attributes:
        system: id of the vehicle, once one is heard.
        heard: ids of all vehicles whose autopilots beat on this link.
        rival: another companion computer of our vehicle is on this link.

    Raises:
        VehicleError: it cannot be opened.
    """

    def __init__(
        self, text: str, timeout: float, system: int, key: bytes | None, record: Tape | None
    ) -> None:
        self.system = system
        self.heard: set[int] = set()
        self.rival = False
        self._record = record
        self._connection = open_connection(text, timeout)
        self._codec = mavlink.MAVLink(None, system or 1, COMPANION)
        self._codec.robust_parsing = True
        if key is not None:
            self._codec.signing.secret_key = key
            self._codec.signing.sign_outgoing = True
            self._codec.signing.timestamp = int((time.time() - SIGNING_EPOCH) * 100_000)

    def close(self) -> None:
        """Let go of the connection."""
        self._connection.close()

    def send(self, message: Message) -> None:
        """Send a message."""
        frame = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        self._keep(frame)
        self._connection.send(frame)

    def receive(self, timeout: float) -> Iterator[Message]:
        """The vehicle's messages, as soon as there are any; none after `timeout` seconds."""
        data = self._connection.receive(timeout)
        if not data:
            return
        if self._connection.datagrams:
            self._forget()
        for message in self._parse(data):
            self._keep(bytes(message.get_msgbuf()))
            system, component = message.get_srcSystem(), message.get_srcComponent()
            beats = message.get_type() == "HEARTBEAT"
            if beats and system == self.system and component == COMPANION:
                self.rival = True
            if component != AUTOPILOT:
                continue
            if beats:
                self.heard.add(system)
                if self.system == 0:
                    self.system = self._codec.srcSystem = system
            if system == self.system:
                self._connection.believe()
                yield message

    def _parse(self, data: bytes) -> list[Message]:
        """The messages that are whole, known and, with a key, genuine.

        pymavlink 2.4 notes a signed frame's time before it checks the signature, so that a forged
        frame from the future would make it deaf to the vehicle: only genuine times are kept.
        """
        signing = self._codec.signing
        heard = dict(signing.stream_timestamps)
        messages = []
        for message in self._codec.parse_buffer(bytearray(data)) or ():
            kind = message.get_type()
            if kind == "BAD_DATA" or kind.startswith("UNKNOWN"):
                continue
            messages.append(message)
            frame = message.get_msgbuf()
            if frame[0] == mavlink.PROTOCOL_MARKER_V2 and frame[2] & SIGNED:
                stream = (frame[-13], message.get_srcSystem(), message.get_srcComponent())
                heard[stream] = int.from_bytes(frame[-12:-6], "little")
        if signing.secret_key is not None:
            signing.stream_timestamps = heard
        return messages

    def _forget(self) -> None:
        """Let go of half a frame: the next datagram is somebody else's, and begins with its own."""
        self._codec.buf, self._codec.buf_index = bytearray(), 0
        self._codec.expected_length = mavlink.HEADER_LEN_V1 + 2

    def _keep(self, frame: bytes) -> None:
        if self._record is not None:
            self._record.write(struct.pack(">Q", time.time_ns() // 1000) + frame)
