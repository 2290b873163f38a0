"""User's TOML to frozen types, with one line for whatever is wrong.

Interface: :func:`read_toml`, :func:`override` (``--set``) and :func:`convert`.  An error names
file, key, bad value and what was expected; unknown keys are errors.
"""

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect as types

from swarm.errors import ConfigError

T = TypeVar("T")
_STEP = re.compile(r"\.([^.\[\]]+)|\[(\d+|\.\.\.)\]")


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file, or of the JSON copy in a run folder.

    Raises:
        ConfigError: the file is missing, unreadable or not TOML.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f'file "{path}" does not exist: expected a swarm file') from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f'file "{path}" cannot be read: {error}') from None
    try:
        read = msgspec.json.decode(text) if path.suffix == ".json" else tomllib.loads(text)
    except (tomllib.TOMLDecodeError, msgspec.DecodeError) as error:
        kind = path.suffix.lstrip(".").upper() or "TOML"
        raise ConfigError(f'file "{path}" is not {kind}: {error}') from None
    if not isinstance(read, dict):
        raise ConfigError(f'file "{path}" holds no table: expected the keys of a swarm file')
    return read


def override(tables: dict[str, Any], settings: Iterable[str]) -> None:
    """Apply ``key=value`` settings in place; ``agents.0.id=x`` reaches into lists.

    The value is read as TOML, and as a plain string where that fails.

    Raises:
        ConfigError: no ``=``, or the key leads through something that is not a table.
    """
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals or not key:
            raise ConfigError(f'--set "{setting}": expected key=value, e.g. optimizer.step=0.1')
        try:
            value = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            value = text
        place: Any = tables
        *parents, last = key.split(".")
        try:
            for parent in parents:
                place = (
                    place[int(parent)] if isinstance(place, list) else place.setdefault(parent, {})
                )
            place[int(last) if isinstance(place, list) else last] = value
        except (TypeError, ValueError, IndexError, AttributeError):
            raise ConfigError(f'--set "{setting}": no key "{key}" in the swarm file') from None


def convert(tables: dict[str, Any], kind: type[T], where: str) -> T:
    """``tables`` as a ``kind``, checked strictly.

    Raises:
        ConfigError: names ``where``, the key, its value and what was expected.
    """
    try:
        return msgspec.convert(tables, kind)
    except msgspec.ValidationError as error:
        problem, _, path = str(error).partition(" - at `$")
        raise ConfigError(f"{where}: {_explain(problem, path.rstrip('`'), tables, kind)}") from None


def _explain(problem: str, path: str, tables: Any, kind: type) -> str:
    """One line for msgspec's ``problem`` at ``path``."""
    steps = [name or index for name, index in _STEP.findall(path)]
    value, expected = tables, types.type_info(kind)
    shown: list[str] = []
    for step in steps:
        shown.append(step)
        value, expected = _descend(value, expected, step)
    key = ".".join(shown) or "file"
    if unknown := re.fullmatch(r"Object contains unknown field `(.+)`", problem):
        name = ".".join([*shown, unknown[1]])
        return f'unknown key "{name}": expected one of {", ".join(_fields(expected, value))}'
    if missing := re.fullmatch(r"Object missing required field `(.+)`", problem):
        return f'key "{".".join([*shown, missing[1]])}" is missing'
    choices = _choices(expected)
    wanted = f"one of {', '.join(choices)}" if choices else problem.removeprefix("Expected ")
    return f"{key} = {_show(value)}: expected {wanted.replace('`', '')}"


def _show(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _descend(value: Any, expected: Any, step: str) -> tuple[Any, Any]:
    """Follow one step of a path through the value and, where it is known, its type."""
    if isinstance(value, list | tuple):
        item = value[int(step)] if step.isdigit() and int(step) < len(value) else value
        return item, getattr(expected, "item_type", None)
    inner = value.get(step) if isinstance(value, dict) else None
    for struct in _structs(expected):
        if (tag := getattr(struct, "tag_field", None)) == step:
            return inner, expected
        chosen = tag is None or not isinstance(value, dict) or value.get(tag) == struct.tag
        for item in struct.fields if chosen else ():
            if item.encode_name == step:
                return inner, item.type
    return inner, None


def _structs(expected: Any) -> list[types.StructType]:
    options = expected.types if isinstance(expected, types.UnionType) else (expected,)
    return [option for option in options if isinstance(option, types.StructType)]


def _fields(expected: Any, value: Any) -> list[str]:
    names: list[str] = []
    for struct in _structs(expected):
        tag = getattr(struct, "tag_field", None)
        if tag is None or not isinstance(value, dict) or value.get(tag) == struct.tag:
            names += [item.encode_name for item in struct.fields]
            names += [tag] if tag else []
    return sorted(set(names))


def _choices(expected: Any) -> list[str]:
    if isinstance(expected, types.LiteralType):
        return [f'"{value}"' for value in expected.values]
    tags = [f'"{struct.tag}"' for struct in _structs(expected) if struct.tag is not None]
    return tags
