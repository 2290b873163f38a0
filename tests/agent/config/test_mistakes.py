"""One line about the first mistake, which agrees with msgspec about what a mistake is."""

from typing import Annotated, Any, Literal

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.inspect import type_info

from agent.config.mistakes import first_mistake

Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Count = Annotated[int, msgspec.Meta(ge=1)]


class Sgd(msgspec.Struct, frozen=True, tag_field="kind", tag="sgd", forbid_unknown_fields=True):
    step: float = 0.1


class Adam(msgspec.Struct, frozen=True, tag_field="kind", tag="adam", forbid_unknown_fields=True):
    decay: Share = 0.0


class Pair(msgspec.Struct, forbid_unknown_fields=True):
    low: int = 0
    high: int = 1

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ValueError("low <= high")


class Whole(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    rounds: Count = 1
    rule: Literal["dcpg", "extra"] = "dcpg"
    optimizer: Sgd | Adam = Sgd()
    hidden: Annotated[tuple[Count, ...], msgspec.Meta(min_length=1)] = (64,)
    edges: tuple[tuple[str, str], ...] = ()
    pair: Pair | None = None
    kwargs: dict[str, Any] = {}
    bounds: dict[str, Share] = {}
    device: str | None = None
    quiet: bool = False
    seconds: float | Literal["auto"] = "auto"


@pytest.mark.parametrize(
    ("tables", "line"),
    [
        ({}, 'key "name" is missing'),
        ({"name": "x", "roundz": 3}, 'unknown key "roundz" (did you mean "rounds"?): expected one'),
        ({"name": "x", "zzz": 3}, 'unknown key "zzz": expected one of bounds, device'),
        ({"name": "x", "pair": {"lwo": 3}}, 'unknown key "pair.lwo" (did you mean "low"?)'),
        ({"name": 3}, "name = 3: expected str"),
        ({"name": "x", "rounds": 0}, "rounds = 0: expected int >= 1"),
        ({"name": "x", "rounds": True}, "rounds = True: expected int >= 1"),
        ({"name": "x", "rounds": "a\nb"}, 'rounds = "a b": expected int >= 1'),
        ({"name": "x", "rule": "foo"}, 'rule = "foo": expected one of "dcpg", "extra"'),
        ({"name": "x", "optimizer": 3}, "optimizer = 3: expected table (object)"),
        ({"name": "x", "optimizer": {}}, 'key "optimizer.kind" is missing: expected one of "sgd"'),
        (
            {"name": "x", "optimizer": {"kind": "rms"}},
            'optimizer.kind = "rms": expected one of "sgd", "adam"',
        ),
        (
            {"name": "x", "optimizer": {"kind": "adam", "decay": 1.5}},
            "optimizer.decay = 1.5: expected float >= 0 and <= 1",
        ),
        (
            {"name": "x", "optimizer": {"kind": "sgd", "step": float("nan")}},
            "optimizer.step = nan: expected finite float",
        ),
        (
            {"name": "x", "bounds": {"a": float("inf")}},
            "bounds.a = inf: expected finite float >= 0 and <= 1",
        ),
        ({"name": "x", "hidden": []}, "hidden = []: expected list of length >= 1"),
        ({"name": "x", "hidden": [1, 0]}, "hidden.1 = 0: expected int >= 1"),
        ({"name": "x", "edges": [["a"]]}, "edges.0 = ['a']: expected list of length 2"),
        ({"name": "x", "device": 1}, "device = 1: expected str"),
        ({"name": "x", "quiet": 1}, "quiet = 1: expected true or false"),
        ({"name": "x", "seconds": "b"}, 'seconds = "b": expected float or one of "auto"'),
        ({"name": "x", "pair": {"low": 2}}, "pair = {'low': 2}: expected low <= high"),
        ([], "file = []: expected table (object)"),
    ],
)
def test_a_line_names_key_value_and_what_was_expected(tables: Any, line: str) -> None:
    found = first_mistake(tables, type_info(Whole))
    assert found is not None
    assert found.startswith(line), found
    assert "\n" not in found


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-1, 2)
    | st.floats(-2, 2)
    | st.sampled_from(["", "dcpg", "extra", "auto", "sgd", "adam", "x"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["kind", "step", "decay", "low", "high", "zzz"]), inner, max_size=3
        )
    ),
    max_leaves=4,
)


@given(
    st.dictionaries(st.sampled_from([*Whole.__struct_fields__, "zzz"]), VALUES, max_size=4).map(
        lambda tables: {"name": "x"} | tables
    )
)
def test_a_mistake_is_what_msgspec_calls_one(tables: dict[str, Any]) -> None:
    try:
        msgspec.convert(tables, Whole)
        good = True
    except msgspec.ValidationError:
        good = False
    found = first_mistake(tables, type_info(Whole))
    assert (found is None) == good, found
    assert found is None or "`" not in found  # msgspec's own words have those
