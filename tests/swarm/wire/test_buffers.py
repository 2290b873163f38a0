"""Vectors that are sent without a copy, and others that are copied."""

import numpy as np

from swarm.wire.buffers import bytes_of, new_vector, sum_of


def test_a_new_vector_is_sent_from_its_own_memory() -> None:
    vector = new_vector(5, np.dtype(np.float32))
    vector[:] = np.arange(5)
    body = bytes_of(vector)
    assert isinstance(body, bytearray)
    assert body == np.arange(5, dtype="<f4").tobytes()
    vector[0] = 7.0
    assert np.frombuffer(body, "<f4")[0] == 7.0


def test_what_is_only_a_part_of_one_is_copied() -> None:
    vector = sum_of(np.arange(5.0), np.ones(5))
    for part in (vector[1:], vector[:3], vector[::-1], vector.reshape(5, 1), np.arange(5.0)):
        assert bytes_of(part) == part.tobytes()
    assert isinstance(bytes_of(vector[1:]), bytes)


def test_sums_have_the_type_and_the_bits_of_a_plain_sum() -> None:
    a, b = np.random.default_rng(0).random((2, 1000), np.float32)
    assert sum_of(a, b).dtype == np.float32
    assert np.array_equal(sum_of(a, b), a + b)
    assert np.array_equal(sum_of(a, b.astype(np.float64)), a + b.astype(np.float64))
