"""The agent's end of the link against garbage: nothing raises, nothing foreign is believed."""

import io
import random
import struct

import pytest
from pymavlink.dialects.v20 import common as mavlink

from agent.vehicle import link as link_module
from agent.vehicle.link import Link, Message
from agent.vehicle.state import READERS, VehicleState

PACKETS = 20_000
KEY = b"a key of thirty-two bytes, yes!!"


class Wire:
    """A connection that yields what was put into it."""

    def __init__(self) -> None:
        self.waiting = b""
        self.sent: list[bytes] = []

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


def frames(rng: random.Random, codec: mavlink.MAVLink) -> bytes:
    """A frame of a kind that is read, with any numbers in it."""
    kind = rng.choice([m for m in mavlink.mavlink_map.values() if m.msgname in READERS])
    values = kind.unpacker.unpack(rng.randbytes(kind.unpacker.size))
    ordered = dict(zip(kind.ordered_fieldnames, values, strict=True))
    message = kind(*[ordered[name] for name in kind.fieldnames])
    return bytes(message.pack(codec))


def test_garbage_never_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random.Random(0)
    link, wire = connect(monkeypatch)
    codec, state = station(), VehicleState()
    for k in range(PACKETS):
        frame = bytearray(frames(rng, codec))
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
    assert link.system == 7


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
