"""User's TOML to frozen types, with one line for whatever is wrong.

Interface: :func:`read_toml`, :func:`override` (``--set``) and :func:`convert`.  An error names
file, key, bad value and what was expected; unknown keys are errors.
"""

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect as types

from agent.config.mistakes import first_mistake
from swarm.errors import ConfigError

T = TypeVar("T")


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file, or of the JSON copy in a run folder.

    Raises:
        ConfigError: the file is missing, unreadable or not TOML.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # with a byte-order mark or without
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
    if mistake := first_mistake(tables, types.type_info(kind)):
        raise ConfigError(f"{where}: {mistake}")
    return msgspec.convert(tables, kind)
