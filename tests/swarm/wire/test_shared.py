"""Bodies that go into shared memory and come out of it again."""

import pytest
import zenoh

from swarm.wire.shared import BODIES, SharedMemory, machine, unwrap

SIZE = 40_000  # [bytes]


@pytest.mark.parametrize("size", [1, 4096, SIZE, 100_001])
def test_what_goes_in_comes_out_and_says_how(size: int) -> None:
    body = bytes(i % 251 for i in range(size))
    assert unwrap(SharedMemory().wrap(body)) == (body, True)
    assert unwrap(zenoh.ZBytes(body)) == (body, False)


def test_a_body_for_several_neighbours_is_copied_once() -> None:
    shared, body = SharedMemory(), bytes(SIZE)
    assert shared.wrap(body) is shared.wrap(body)
    assert shared.wrap(bytearray(body)) is not shared.wrap(body)


def test_a_pool_that_receivers_hold_says_so() -> None:
    shared, held = SharedMemory(), []
    with pytest.raises(zenoh.ZError):
        for i in range(3 * BODIES):
            held.append(shared.wrap(bytes([i]) * SIZE))
    assert [unwrap(payload)[0][0] for payload in held] == list(range(len(held)))


def test_a_pool_follows_the_size_of_the_bodies() -> None:
    shared = SharedMemory()
    for size in (SIZE, 8 * SIZE, SIZE):
        assert len(unwrap(shared.wrap(b"x" * size))[0]) == size


def test_a_machine_has_one_name() -> None:
    assert machine() == machine()
    assert len(machine()) <= 64
