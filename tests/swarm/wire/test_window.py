"""The window follows a link; all on a clock that the test moves."""

import pytest

from swarm.wire.window import FIRST, GAIN, LARGEST_CHUNK, LEAST_CHUNK, Window


def test_an_unmeasured_link_gets_little_and_small_chunks() -> None:
    window = Window()
    assert (window.size, window.chunk()) == (FIRST, LEAST_CHUNK)


@pytest.mark.parametrize("mbit, trip", [(2, 0.3), (20, 0.04), (1000, 0.3)])
def test_a_measured_link_gets_what_it_carries_in_a_round_trip(mbit: float, trip: float) -> None:
    rate, window = mbit * 1e6 / 8, Window()
    for i in range(3):
        window.acknowledged(65_536, trip, rate, limited=False, now=float(i))
    assert window.size >= rate * trip
    assert window.size <= max(FIRST, GAIN * rate * (trip + window.slack()))
    assert LEAST_CHUNK <= window.chunk() <= LARGEST_CHUNK


def test_a_queue_brings_the_window_back() -> None:
    rate, window = 250_000.0, Window(size=8_000_000)
    window.acknowledged(1, 0.04, rate, limited=True, now=0.0)
    window.acknowledged(100_000, 4.0, rate, limited=True, now=1.0)
    assert window.size == int(GAIN * rate * (0.04 + window.slack()))


def test_an_old_extreme_is_forgotten() -> None:
    window = Window()
    for i in range(40):
        window.acknowledged(1, 0.01 if i == 0 else 0.2, 1e6 if i == 0 else 1e5, True, float(i))
    assert (window.rate, window.round_trip) == (1e5, 0.2)
