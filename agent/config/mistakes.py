"""What is wrong with a user's tables, judged by the types that they are to become.

Interface: :func:`first_mistake`.  The types (``msgspec.inspect``) are walked beside the tables, so
a line names the key, its value and what was expected, in our words, whatever a release of msgspec
says about it.  Numbers must be finite.
"""

import difflib
import math
from collections.abc import Sequence
from typing import Any

import msgspec
from msgspec import inspect as types

LONGEST = 60  # letters of a value that are shown


def first_mistake(value: Any, expected: types.Type, key: str = "") -> str | None:
    """One line about the first thing in ``value`` that is not as ``expected``; None: all is well.

    Args:
        value: tables, lists, numbers, ... as TOML or JSON has them.
        expected: the type they are to become.
        key: where ``value`` stands, with dots; empty for all of it.
    """
    match expected:
        case types.UnionType():
            return _in_union(value, expected, key)
        case types.StructType() if isinstance(value, dict):
            return _in_table(value, expected, key)
        case types.DictType() if isinstance(value, dict):
            below = ((name, item, expected.value_type) for name, item in value.items())
        case types.TupleType() if _is_list(value, len(expected.item_types)):
            below = ((str(i), value[i], kind) for i, kind in enumerate(expected.item_types))
        case types.ListType() | types.VarTupleType() if _is_list(value) and _has_room(
            len(value), expected
        ):
            below = ((str(i), item, expected.item_type) for i, item in enumerate(value))
        case _:
            return None if _fits(value, expected) else _line(key, value, _words(expected, value))
    found = (first_mistake(item, kind, _join(key, name)) for name, item, kind in below)
    return next((mistake for mistake in found if mistake), None)


def _in_table(value: dict[str, Any], expected: types.StructType, key: str) -> str | None:
    """Of a table that becomes a struct: strange keys, absent ones, its values, its own checks."""
    names = sorted(field.encode_name for field in expected.fields)
    if expected.tag_field is not None:
        names = sorted([*names, expected.tag_field])
        if value.get(expected.tag_field, expected.tag) != expected.tag:
            return _of_another_kind(value[expected.tag_field], [expected], key)
    if expected.forbid_unknown_fields:
        for name in value:
            if name not in names:
                return _unknown(_join(key, name), name, names)
    for field in expected.fields:
        if field.required and field.encode_name not in value:
            return f'key "{_join(key, field.encode_name)}" is missing'
    for field in expected.fields:
        if field.encode_name in value:
            place = _join(key, field.encode_name)
            if mistake := first_mistake(value[field.encode_name], field.type, place):
                return mistake
    try:
        msgspec.convert(value, expected.cls)
    except msgspec.ValidationError as error:
        if error.__cause__ is None:  # a kind of check that the walk does not know
            return f"{key or 'file'}: {error}"
        return _line(key, value, str(error.__cause__))  # of the struct's own __post_init__
    return None


def _in_union(value: Any, expected: types.UnionType, key: str) -> str | None:
    structs = [option for option in expected.types if isinstance(option, types.StructType)]
    if isinstance(value, dict) and structs:
        tag = structs[0].tag_field
        if tag is None:
            return first_mistake(value, structs[0], key)
        if tag not in value:
            return f'key "{_join(key, tag)}" is missing: expected {_one_of(structs)}'
        for struct in structs:
            if struct.tag == value[tag]:
                return first_mistake(value, struct, key)
        return _of_another_kind(value[tag], structs, key)
    options = [option for option in expected.types if not isinstance(option, types.NoneType)]
    found = [first_mistake(value, option, key) for option in options]
    if None in found or (value is None and len(options) < len(expected.types)):
        return None
    if len(found) == 1:
        return found[0]
    wanted = dict.fromkeys(_words(option, value) for option in options)
    return _line(key, value, " or ".join(wanted))


def _fits(value: Any, expected: types.Type) -> bool:
    """Whether a value that holds no others is good; what nobody here knows is left to msgspec."""
    match expected:
        case types.BoolType():
            return isinstance(value, bool)
        case types.IntType():
            return (
                isinstance(value, int) and not isinstance(value, bool) and _within(value, expected)
            )
        case types.FloatType():
            number = isinstance(value, int | float) and not isinstance(value, bool)
            return number and math.isfinite(value) and _within(value, expected)
        case types.StrType():
            return isinstance(value, str) and _has_room(len(value), expected)
        case types.LiteralType():
            return value in expected.values
        case types.NoneType():
            return value is None
    return not _holds_others(expected)


def _holds_others(expected: types.Type) -> bool:
    kinds = (types.StructType, types.DictType, types.ListType, types.TupleType, types.VarTupleType)
    return isinstance(expected, kinds)


def _within(value: float, expected: types.IntType | types.FloatType) -> bool:
    return (
        (expected.ge is None or value >= expected.ge)
        and (expected.gt is None or value > expected.gt)
        and (expected.le is None or value <= expected.le)
        and (expected.lt is None or value < expected.lt)
    )


def _is_list(value: Any, length: int | None = None) -> bool:
    return isinstance(value, list | tuple) and length in (None, len(value))


def _has_room(length: int, expected: types.StrType | types.ListType | types.VarTupleType) -> bool:
    least, most = expected.min_length or 0, expected.max_length
    return least <= length and (most is None or length <= most)


def _words(expected: types.Type, value: Any) -> str:
    """What is expected where ``value`` stands."""
    match expected:
        case types.BoolType():
            return "true or false"
        case types.IntType() | types.FloatType():
            name = "int" if isinstance(expected, types.IntType) else "float"
            if isinstance(value, float) and not math.isfinite(value):
                name = f"finite {name}"
            limits = {">=": expected.ge, ">": expected.gt, "<=": expected.le, "<": expected.lt}
            said = [f"{sign} {limit:.10g}" for sign, limit in limits.items() if limit is not None]
            return " ".join([name, " and ".join(said)]).strip()
        case types.StrType():
            return "str" + _length(expected)
        case types.LiteralType():
            return "one of " + ", ".join(_show(choice) for choice in expected.values)
        case types.ListType() | types.VarTupleType():
            return "list" + _length(expected)
        case types.TupleType():
            return f"list of length {len(expected.item_types)}"
        case types.StructType() | types.DictType():
            return "table (object)"
    return "something else"


def _length(expected: types.StrType | types.ListType | types.VarTupleType) -> str:
    limits = {">=": expected.min_length, "<=": expected.max_length}
    said = [f"{sign} {limit}" for sign, limit in limits.items() if limit is not None]
    return f" of length {' and '.join(said)}" if said else ""


def _unknown(key: str, name: str, names: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, names, 1)
    guess = f' (did you mean "{near[0]}"?)' if near else ""
    return f'unknown key "{key}"{guess}: expected one of {", ".join(names)}'


def _of_another_kind(tag: Any, structs: Sequence[types.StructType], key: str) -> str:
    return _line(_join(key, str(structs[0].tag_field)), tag, _one_of(structs))


def _one_of(structs: Sequence[types.StructType]) -> str:
    return "one of " + ", ".join(_show(struct.tag) for struct in structs)


def _line(key: str, value: Any, wanted: str) -> str:
    return f"{key or 'file'} = {_show(value)}: expected {wanted}"


def _show(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    text = " ".join(text.split())  # one line
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _join(key: str, name: str) -> str:
    return f"{key}.{name}" if key else str(name)
