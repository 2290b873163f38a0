"""The agent's end of the link against garbage: nothing raises, nothing foreign is believed."""

import io
import math
import random
import struct

import pytest
from pymavlink.dialects.v20 import common as mavlink
from pymavlink.generator.mavcrc import x25crc

from agent.vehicle import link as link_module
from agent.vehicle.link import Link, Message
from agent.vehicle.state import FARTHEST, READERS, VehicleState

PACKETS = 20_000
KEY = b"a key of thirty-two bytes, yes!!"


class Wire:
    """A connection that yields what was put into it."""

    datagrams = True

    def __init__(self) -> None:
        self.waiting = b""
        self.sent: list[bytes] = []
        self.believed = 0

    def believe(self) -> None:
        self.believed += 1

    def receive(self, timeout: float) -> bytes:
        data, self.waiting = self.waiting, b""
        return data

    def send(self, data: bytes) -> None:
        self.sent.append(data)

    def close(self) -> None:
        """Nothing to let go of."""


def connect(
    monkeypatch: pytest.MonkeyPatch, key: bytes | None = None, record: io.BytesIO | None = None
) -> tuple[Link, Wire]:
    wire = Wire()
    monkeypatch.setattr(link_module, "open_connection", lambda text, timeout: wire)
    return Link("udpin:0.0.0.0:1", 1.0, 0, key, record), wire


def station(system: int = 1, component: int = 1, key: bytes | None = None) -> mavlink.MAVLink:
    codec = mavlink.MAVLink(None, system, component)
    if key is not None:
        codec.signing.secret_key, codec.signing.sign_outgoing = key, True
        codec.signing.timestamp = 10**14  # later than any clock
    return codec


def heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(2, 12, 1, 0, 3, 3)


def frames(rng: random.Random) -> bytes:
    """A valid frame with any numbers, of a kind that is read or of any other, MAVLink 2 or 1."""
    read = rng.random() < 0.7
    kind = rng.choice([m for m in mavlink.mavlink_map.values() if m.msgname in READERS or not read])
    payload = rng.randbytes(kind.unpacker.size)
    if kind.id < 256 and rng.random() < 0.3:
        head = struct.pack("<BBBBB", len(payload), rng.randrange(256), 1, 1, kind.id)
        marker = b"\xfe"
    else:
        number = struct.pack("<I", kind.id)[:3]
        head = struct.pack("<BBBBBB", len(payload), 0, 0, rng.randrange(256), 1, 1) + number
        marker = b"\xfd"
    checksum = x25crc(head + payload)
    checksum.accumulate(struct.pack("B", kind.crc_extra))
    return marker + head + payload + struct.pack("<H", checksum.crc)


def test_garbage_never_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random.Random(0)
    link, wire = connect(monkeypatch)
    state = VehicleState()
    for k in range(PACKETS):
        frame = bytearray(frames(rng))
        if k % 4 == 1:
            frame[rng.randrange(len(frame))] ^= 1 << rng.randrange(8)
        elif k % 4 == 2:
            del frame[rng.randrange(len(frame)) :]
        elif k % 4 == 3:
            frame = bytearray(b"\xfd" + rng.randbytes(rng.randrange(40)))
        wire.waiting = bytes(frame)
        for message in link.receive(0.0):
            if message.get_type() in READERS:
                state = READERS[message.get_type()](state, message, 1.0)
                known = (*state.position, *state.velocity, *state.attitude)
                assert not any(abs(number) > FARTHEST for number in known)
                assert state.attitude_at < 0 or all(map(math.isfinite, state.attitude))


def test_only_the_first_autopilot_is_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    link, wire = connect(monkeypatch)
    for system, component, believed in (
        (7, 190, False),  # a ground station
        (7, 1, True),
        (8, 1, False),  # another vehicle
        (7, 100, False),  # a camera
        (7, 1, True),
    ):
        wire.waiting = bytes(heartbeat().pack(station(system, component)))
        assert bool(list(link.receive(0.0))) is believed
    assert link.system == 7 and link.heard == {7, 8}
    assert wire.believed == 2  # where the others spoke from is not answered


def test_short_frames_of_mavlink_1_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """EXTENDED_SYS_STATE has ten bytes there; a frame cut off before it does no harm."""
    link, wire = connect(monkeypatch)
    landed = mavlink.MAVLink_extended_sys_state_message(0, 1)
    for message in (heartbeat(), landed):
        wire.waiting = bytes(message.pack(station(), force_mavlink1=True))
        assert [m.get_type() for m in link.receive(0.0)] == [message.get_type()]
        wire.waiting = bytes(message.pack(station()))[:-3]
        assert list(link.receive(0.0)) == []


def test_another_companion_of_the_vehicle_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    link, wire = connect(monkeypatch)
    for system, component, rival in ((1, 1, False), (2, 191, False), (1, 191, True)):
        wire.waiting = bytes(heartbeat().pack(station(system, component)))
        list(link.receive(0.0))
        assert link.rival is rival


def test_with_a_key_only_what_is_signed_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    link, wire = connect(monkeypatch, KEY)
    for key, believed in ((None, False), (bytes(32), False), (KEY, True)):
        wire.waiting = bytes(heartbeat().pack(station(key=key)))
        assert bool(list(link.receive(0.0))) is believed


def test_the_tape_has_both_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    tape = io.BytesIO()
    link, wire = connect(monkeypatch, record=tape)
    wire.waiting = theirs = bytes(heartbeat().pack(station()))
    assert len(list(link.receive(0.0))) == 1
    link.send(heartbeat())
    (ours,) = wire.sent
    written = tape.getvalue()
    assert written[8 : 8 + len(theirs)] == theirs
    assert written[-len(ours) :] == ours
    first, second = (struct.unpack(">Q", written[at : at + 8])[0] for at in (0, 8 + len(theirs)))
    assert first <= second
