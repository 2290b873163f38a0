"""Frames: what our codec writes pymavlink reads, and the other way round; signing; streams."""

import math

import pytest

from sim.vehicle.codec import Attitude, Codec, LocalPosition, SetPointMessage, Splitter
from sim.vehicle.dialect import mavlink

KEY = bytes(range(32))
SETPOINT = SetPointMessage(7, 1, 2, 3, 4, 5, 6, 0, 0, 0, math.nan, 0.5, 2503, 1, 1, 8)
HOT = [SETPOINT, LocalPosition(1, 2, 3, 4, 5, 6, 0), Attitude(9, 0.1, 0, 0, 0, 0, 0)]
OTHERS = [
    mavlink.MAVLink_statustext_message(6, b"hello"),
    mavlink.MAVLink_param_value_message(b"A_NAME", 1.5, 9, 3, 2),
    mavlink.MAVLink_battery_status_message(0, 0, 1, 2500, [4000] * 10, 5, -1, -1, 90),
    mavlink.MAVLink_home_position_message(1, 2, 3, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 7),
    mavlink.MAVLink_heartbeat_message(2, 12, 157, 0x60000, 4, 3),
]


@pytest.mark.parametrize("message", HOT, ids=lambda m: type(m).__name__)
def test_pymavlink_reads_what_is_packed_by_hand(message: tuple[float, ...]) -> None:
    theirs = mavlink.MAVLink(None).decode(bytearray(Codec(3, 1).encode(message)))
    for name, value in message._asdict().items():  # type: ignore[attr-defined]
        assert getattr(theirs, name) == pytest.approx(value, nan_ok=True)
    assert (theirs.get_srcSystem(), theirs.get_srcComponent()) == (3, 1)


@pytest.mark.parametrize("message", OTHERS, ids=lambda m: m.get_type())
def test_our_frames_are_pymavlinks_byte_for_byte(message: mavlink.MAVLink_message) -> None:
    assert Codec(3, 1).encode(message) == message.pack(mavlink.MAVLink(None, 3, 1))


@pytest.mark.parametrize("message", [*HOT, *OTHERS], ids=lambda m: type(m).__name__)
def test_what_is_written_is_read(message: mavlink.MAVLink_message) -> None:
    back = Codec(2, 1, KEY).decode(Codec(3, 1, KEY).encode(message))
    assert type(back) is type(message)
    assert Codec(9, 1).encode(back) == Codec(9, 1).encode(message)


def test_mavlink_1_is_understood() -> None:
    frame = OTHERS[4].pack(mavlink.MAVLink(None, 3, 1), force_mavlink1=True)
    message = Codec(2, 1).decode(frame)
    assert message is not None
    assert message.autopilot == 12


def test_signing() -> None:
    """Genuine and fresh passes, once; unsigned, forged, replayed and foreign does not."""
    sender, receiver = Codec(3, 1, KEY), Codec(2, 1, KEY)
    first, second = sender.encode(SETPOINT), sender.encode(SETPOINT)
    assert receiver.decode(first) is not None
    assert receiver.decode(first) is None
    assert receiver.decode(Codec(3, 1).encode(SETPOINT)) is None
    assert receiver.decode(Codec(3, 1, bytes(32)).encode(SETPOINT)) is None
    forged = second[:20] + bytes((second[20] ^ 1,)) + second[21:]
    assert receiver.decode(forged) is None
    late = bytearray(second)  # a stamp from the far future must not lock the stream out
    late[-12:-6] = b"\xff" * 6
    assert receiver.decode(bytes(late)) is None
    assert receiver.decode(second) is not None
    with pytest.raises(ValueError, match="32 bytes"):
        Codec(1, 1, b"short")


def test_pymavlink_accepts_our_signature() -> None:
    theirs = mavlink.MAVLink(None)
    theirs.signing.secret_key = KEY
    assert theirs.decode(bytearray(Codec(3, 1, KEY).encode(SETPOINT))).get_signed()


def test_a_stream_may_be_cut_anywhere() -> None:
    codec = Codec(3, 1)
    frames = [codec.encode(message) for message in (*HOT, *OTHERS)]
    data = b"noise" + b"".join(frames[:4]) + b"\x00\x01" + b"".join(frames[4:])
    for size in (1, 2, 7, 50):
        splitter = Splitter()
        found = [f for at in range(0, len(data), size) for f in splitter.feed(data[at : at + size])]
        assert found == frames
