"""Bodies that go into shared memory and come out of it again."""

import pytest
import zenoh

from swarm.wire.parcels import BODIES, LARGE, Parcels, unwrap


@pytest.mark.parametrize("size", [0, 1, LARGE - 1, LARGE, 100_001])
@pytest.mark.parametrize("shared", [False, True])
def test_what_goes_in_comes_out(size: int, shared: bool) -> None:
    body = bytes(i % 251 for i in range(size))
    parcel = Parcels(shared).wrap(body)
    assert (parcel.as_shm() is not None) == (shared and size >= LARGE)
    assert unwrap(parcel) == body


def test_a_pool_that_receivers_hold_is_no_obstacle() -> None:
    parcels = Parcels(shared_memory=True)
    held = [parcels.wrap(bytes([i]) * LARGE) for i in range(3 * BODIES)]
    assert [unwrap(parcel)[0] for parcel in held] == list(range(3 * BODIES))
    assert any(parcel.as_shm() is None for parcel in held)


def test_a_pool_follows_the_size_of_the_bodies() -> None:
    parcels = Parcels(shared_memory=True)
    for size in (LARGE, 8 * LARGE, LARGE):
        parcel: zenoh.ZBytes = parcels.wrap(b"x" * size)
        assert parcel.as_shm() is not None
        assert len(unwrap(parcel)) == size
