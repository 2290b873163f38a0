"""What travels is read back; everything else is refused under its name, before it is used."""

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.errors import PayloadError
from swarm.mixing.compression import Plain
from swarm.protocol.messages import PROTOCOL, ParameterHeader, Statement
from swarm.wire.payload import (
    HEADER_LIMIT,
    Layout,
    Message,
    check_norm,
    decode_body,
    decode_header,
    encode_header,
)

LAYOUT = Layout("test", (("logits", (3, 2)),))
BODY = np.arange(6, dtype="<f4").tobytes()


def decode(attachment: bytes | None, body: bytes, layout: Layout, codec: Plain) -> Message:
    return Message(decode_header(attachment, layout), decode_body(body, layout, codec))


def header(**changes: object) -> bytes:
    fields: dict[str, object] = {
        "version": PROTOCOL,
        "fingerprint": LAYOUT.fingerprint,
        "agent": "d0",
        "incarnation": "1f",
        "round": 3,
        "neighbours": {"d1": [0, True, [], 0]},
    }
    return msgspec.msgpack.encode(fields | changes)


def test_round_trip() -> None:
    sent = ParameterHeader(
        version=PROTOCOL,
        fingerprint=LAYOUT.fingerprint,
        agent="d0",
        incarnation="1f",
        round=3,
        neighbours={"d1": Statement()},
    )
    message = decode(encode_header(sent), BODY, LAYOUT, Plain())
    assert message.header == sent
    np.testing.assert_array_equal(message.vector, np.arange(6))
    assert message.vector.dtype == np.float32


@pytest.mark.parametrize(
    ("cause", "attachment", "body"),
    [
        ("header", None, BODY),
        ("header", b"", BODY),
        ("header", b"\x80" * (HEADER_LIMIT + 1), BODY),
        ("header", b"\x93\x01\x02\x03", BODY),
        ("header", header(round="3"), BODY),
        ("header", header(extra=1), BODY),
        ("version", header(version=PROTOCOL + 1), BODY),
        ("fingerprint", header(fingerprint="0" * 16), BODY),
        ("round", header(round=-1), BODY),
        ("header", header(learned=-1.0), BODY),
        ("header", header(learned=float("nan")), BODY),
        ("length", header(), BODY[:-1]),
        ("length", header(), BODY + b"\0"),
        ("finite", header(), np.array([0, 1, np.nan, 3, 4, 5], "<f4").tobytes()),
        ("finite", header(), np.array([0, 1, -np.inf, 3, 4, 5], "<f4").tobytes()),
    ],
)
def test_what_is_wrong_is_refused_by_cause(
    cause: str, attachment: bytes | None, body: bytes
) -> None:
    with pytest.raises(PayloadError) as error:
        decode(attachment, body, LAYOUT, Plain())
    assert error.value.cause == cause


def test_rounds_after_the_last_are_refused() -> None:
    assert decode_header(header(round=9), LAYOUT, last=9).round == 9
    with pytest.raises(PayloadError, match="round 10: expected 0 to 9"):
        decode_header(header(round=10), LAYOUT, last=9)


def test_who_claims_to_have_learned_more_than_there_is_is_refused() -> None:
    assert decode_header(header(round=90, learned=9.0), LAYOUT, most=9).learned == 9.0
    with pytest.raises(PayloadError, match=r"learned 9\.5 rounds: expected at most 9"):
        decode_header(header(learned=9.5), LAYOUT, most=9)


def test_who_is_too_far_out_is_refused() -> None:
    check_norm(np.full(4, 5.0), 10.0)
    with pytest.raises(PayloadError, match="norm 12: expected at most 10"):
        check_norm(np.full(4, 6.0), 10.0)


def test_large_finite_parameters_are_not_mistaken_for_infinite_ones() -> None:
    body = np.full(6, 1e30, "<f4").tobytes()
    assert decode(header(), body, LAYOUT, Plain()).vector[0] == np.float32(1e30)


@given(st.binary(max_size=200), st.binary(max_size=40))
def test_noise_is_refused_and_never_anything_worse(attachment: bytes, body: bytes) -> None:
    with pytest.raises(PayloadError):
        decode(attachment, body, LAYOUT, Plain())


def test_a_fingerprint_is_shared_only_by_equal_layouts() -> None:
    others = [
        Layout("other", LAYOUT.parts),
        Layout("test", (("logits", (2, 3)),)),
        Layout("test", (("values", (3, 2)),)),
        Layout("test", LAYOUT.parts, precision="float64"),
        Layout("test", LAYOUT.parts, copies=2),
        Layout("test", LAYOUT.parts, codec="int8"),
    ]
    assert Layout("test", (("logits", (3, 2)),)).fingerprint == LAYOUT.fingerprint
    assert len({other.fingerprint for other in [LAYOUT, *others]}) == len(others) + 1
