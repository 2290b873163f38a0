import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from swarm.errors import PayloadError
from swarm.mixing.compression import BLOCK, CODECS, Half, Int8, Plain
from swarm.mixing.rules import Mixer, Mixing

Vector = NDArray[np.float32]
vectors = arrays(
    np.float32, st.integers(1, 3 * BLOCK), elements=st.floats(-1e4, 1e4, width=32, allow_nan=False)
)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@settings(max_examples=40, deadline=None)
@given(vector=vectors)
def test_plain_returns_the_same_bits(precision: str, vector: Vector) -> None:
    wide = vector.astype(precision)
    back = Plain().decode(Plain().encode(wide), wide.size, wide.dtype)
    assert back.tobytes() == wide.tobytes()


@settings(max_examples=40, deadline=None)
@given(vector=vectors)
def test_half_is_right_to_eleven_bits(vector: Vector) -> None:
    back = Half().decode(Half().encode(vector), vector.size, vector.dtype)
    assert back.dtype == vector.dtype
    assert (np.abs(back - vector) <= np.maximum(np.abs(vector) * 2.0**-11, 2.0**-25)).all()


def test_half_saturates_instead_of_overflowing() -> None:
    back = Half().decode(Half().encode(np.array([1e9, -1e9])), 2, np.dtype(np.float64))
    np.testing.assert_array_equal(back, (65504, -65504))


@settings(max_examples=40, deadline=None)
@given(vector=vectors)
def test_int8_is_right_to_half_a_level_of_its_block(vector: Vector) -> None:
    back = Int8().decode(Int8().encode(vector), vector.size, vector.dtype)
    for start in range(0, vector.size, BLOCK):
        block = slice(start, start + BLOCK)
        level = np.abs(vector[block]).max() / 127
        assert np.abs(back[block] - vector[block]).max() <= level * 0.5001 + 1e-30


@pytest.mark.parametrize(("kind", "size"), [("none", 1600), ("fp16", 800), ("int8", 428)])
def test_bytes_of_400_parameters(kind: str, size: int) -> None:
    assert len(CODECS[kind]().encode(np.zeros(400, np.float32))) == size  # type: ignore[index]


@pytest.mark.parametrize("kind", list(CODECS))
@pytest.mark.parametrize("change", [-1, 1])
def test_a_wrong_length_is_refused(kind: str, change: int) -> None:
    codec = CODECS[kind]()  # type: ignore[index]
    body = codec.encode(np.ones(70, np.float32)) + b"x"
    body = body if change > 0 else body[:-2]
    with pytest.raises(PayloadError, match="bytes of parameters"):
        codec.decode(body, 70, np.dtype(np.float32))


@pytest.mark.parametrize("kind", ["fp16", "int8"])
def test_error_feedback_catches_up_however_many_messages_are_sent(kind: str) -> None:
    """The sum of what was said never strays from the sum of what was meant by more than one error.

    Receivers may lose messages: each stands alone.
    """
    rng = np.random.default_rng(0)
    mixer = Mixer(Mixing(compression=kind))  # type: ignore[arg-type]
    meant, said = np.zeros(100), np.zeros(100)
    for _ in range(200):
        theta = rng.normal(size=100)
        body = mixer.outgoing(theta, theta)
        meant, said = meant + theta, said + mixer.codec.decode(body, 100, theta.dtype)
        assert np.abs(meant - said).max() <= 0.03
        mixer.mix(theta, np.zeros(100), {}, {})
