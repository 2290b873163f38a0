"""100,000 random, mutated, truncated, replayed and foreign packets: no crash, no movement."""

import random
from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim.vehicle.autopilot import Autopilot
from sim.vehicle.codec import Codec, SetPointMessage, Splitter
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import ARDUPILOT, PX4, Flavour, Mode
from sim.vehicle.quadrotor import Quadrotor

PACKETS = 100_000
KEY = b"a key of thirty-two bytes, yes!!"
ODD = [float("nan"), float("inf"), -float("inf"), 0.0, -0.0, 1e38, -1e38, 1e-40, 1.0, 300.0]


def armed(flavour: Flavour, key: bytes | None) -> tuple[Autopilot, Codec]:
    """A vehicle that hovers and obeys set points, and its end of the link."""
    pilot = Autopilot(Quadrotor(), flavour, lockstep=True)
    pilot.place(np.array([0.0, 0.0, -5.0]), 0.0)
    pilot.parameters.set("COM_OF_LOSS_T", 60.0)
    pilot.change_mode(Mode.HOLD)
    pilot.advance(1.0)
    return pilot, Codec(1, 1, key)


def give(pilot: Autopilot, codec: Codec, data: bytes) -> None:
    for frame in Splitter().feed(data):
        message = codec.decode(frame)
        if message is not None:
            for reply in pilot.handle(message):
                codec.encode(reply)


def any_message(rng: random.Random, target: int) -> Message:
    """A message of any kind with any numbers in it, addressed to `target` where it can be."""
    kind = rng.choice(KINDS)
    size = kind.unpacker.size
    payload = bytes(rng.choices(BYTES, k=size))
    values = kind.unpacker.unpack(payload)
    message = kind.__new__(kind)
    flat = iter(values)
    for name, count in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True):
        first = next(flat)
        if isinstance(first, bytes) or not count:
            setattr(message, name, first)
        else:
            setattr(message, name, [first, *(next(flat) for _ in range(count - 1))])
        if name == "target_system":
            setattr(message, name, target)
        if name in {"target_component"}:
            setattr(message, name, 1)
    return message


KINDS = [kind for kind in mavlink.mavlink_map.values() if not kind.msgname.startswith("HIL")]
BYTES = range(256)
COMMANDS = [400, 22, 21, 20, 176, 192, 178, 115, 300, 193, 179, 31010, 511, 512]


def orders(rng: random.Random, target: int) -> Message:
    """What would move it, if it were meant for it."""
    if rng.random() < 0.5:
        values: list[Any] = [rng.uniform(-5, 5) for _ in range(11)]
        values += [rng.choice([2503, 2552, 1479, 0]), target, 1, 1]
        return SetPointMessage._make([0, *values])
    params = [rng.choice([0, 1, 4, 6, 21196, *ODD]) for _ in range(7)]
    return mavlink.MAVLink_command_long_message(target, 1, rng.choice(COMMANDS), 0, *params)


def still(pilot: Autopilot) -> None:
    assert pilot.armed
    assert pilot.mode is Mode.HOLD
    assert np.linalg.norm(pilot.body.position - (0, 0, -5)) < 0.05
    assert np.linalg.norm(pilot.body.velocity) < 0.05


def hail(flavour: Flavour, count: int, seed: int) -> None:
    """Packets that must all be without effect on the flight."""
    rng = random.Random(seed)
    pilot, codec = armed(flavour, KEY)
    friend, stranger = Codec(255, 190, KEY), Codec(255, 190, bytes(32))
    heard = [friend.encode(orders(rng, 9)) for _ in range(50)]
    for frame in heard:
        give(pilot, codec, frame)

    def noise() -> bytes:
        return bytes((0xFD,)) + rng.randbytes(rng.randrange(60))

    def mutated() -> bytes:
        frame = bytearray(friend.encode(orders(rng, 1)))
        for bit in rng.sample(range(8 * len(frame)), rng.randint(1, 3)):
            frame[bit // 8] ^= 1 << bit % 8
        return bytes(frame)

    def truncated() -> bytes:
        frame = friend.encode(orders(rng, 1))
        return frame[: rng.randrange(len(frame))]

    makers: list[Callable[[], bytes]] = [
        noise,
        mutated,
        truncated,
        lambda: rng.choice(heard),  # replayed
        lambda: stranger.encode(orders(rng, 1)),  # signed by somebody else
        lambda: Codec(255, 190).encode(orders(rng, 1)),  # not signed
        lambda: friend.encode(any_message(rng, 9)),  # foreign
        lambda: friend.encode(orders(rng, 9)),  # foreign
    ]
    for k in range(count):
        packet = makers[k % len(makers)]()
        give(pilot, codec, packet)
        if k % 200 == 0:
            pilot.advance(0.1)
            still(pilot)
    pilot.advance(2.0)
    still(pilot)


def test_a_hail_of_packets_neither_crashes_nor_moves_it() -> None:
    hail(PX4, PACKETS // 2, seed=1)
    hail(ARDUPILOT, PACKETS // 2, seed=2)


def test_any_message_with_any_numbers_leaves_the_state_finite() -> None:
    """Addressed to us and valid: it may do what it says, but never harm the arithmetic."""
    for flavour in (PX4, ARDUPILOT):
        rng = random.Random(3)
        pilot, codec = armed(flavour, None)
        sender = Codec(255, 190)
        for k in range(10_000):
            make = orders if k % 3 else any_message
            give(pilot, codec, sender.encode(make(rng, 1)))
            if k % 50 == 0:
                pilot.advance(0.1)
                assert np.isfinite(pilot.body.state).all()
                for reply in pilot.advance(1.0):
                    codec.encode(reply)


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(st.binary(max_size=80), max_size=10))
def test_any_bytes_at_all(chunks: list[bytes]) -> None:
    pilot, codec = armed(PX4, None)
    splitter = Splitter()
    for chunk in chunks:
        for frame in splitter.feed(b"\xfd" + chunk):
            message = codec.decode(frame)
            assert message is None or isinstance(pilot.handle(message), list)
    assert len(splitter._waiting) <= 300
    still(pilot)
