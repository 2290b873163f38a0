"""``--set estimator.kind=a2c`` and what becomes of the keys of the kind that the file has.

Estimator, optimiser and policy are one of several kinds, each with keys of its own.  Who changes
the kind on the command line cannot delete keys: those of the file that the new kind does not know
are dropped, and named.  Keys set on the command line stay, to be refused if they do not fit.
"""

from typing import Any

import msgspec
from msgspec import inspect as types


def kinds_in(tables: dict[str, Any], kind: type[msgspec.Struct]) -> dict[str, str]:
    """The kind that ``tables`` name for each key of ``kind`` that has several."""
    return {
        key: str(tables[key][tag])
        for key, tag, _ in _unions(kind)
        if isinstance(tables.get(key), dict) and tag in tables[key]
    }


def drop_foreign(
    tables: dict[str, Any], kind: type[msgspec.Struct], before: dict[str, str], chosen: set[str]
) -> list[str]:
    """Drop, in place, what the kinds chosen on the command line do not know.

    Args:
        tables: the file with the settings of the command line.
        kind: type of the whole file.
        before: the kinds that the file named, from :func:`kinds_in`.
        chosen: keys that were set on the command line, with dots.

    Returns:
        A line for each table that lost keys.
    """
    lines = []
    for key, tag, options in _unions(kind):
        table = tables.get(key)
        if not isinstance(table, dict) or f"{key}.{tag}" not in chosen:
            continue
        now, old = table.get(tag), before.get(key)
        if now not in options or now == old:
            continue
        dropped = [
            name
            for name in table
            if name not in {tag, *options[now]} and f"{key}.{name}" not in chosen
        ]
        for name in dropped:
            del table[name]
        if dropped:
            whose = f" of {old}" if old else ""
            lines.append(f"{key}.{tag} = {now}: dropped {', '.join(dropped)}{whose}")
    return lines


def _unions(kind: type[msgspec.Struct]) -> list[tuple[str, str, dict[Any, set[str]]]]:
    """(key, its tag field, the keys of each kind) of the tagged unions of a struct."""
    found = []
    info = types.type_info(kind)
    assert isinstance(info, types.StructType)
    for field in info.fields:
        options = field.type.types if isinstance(field.type, types.UnionType) else ()
        structs = [option for option in options if isinstance(option, types.StructType)]
        if structs and structs[0].tag_field:
            keys: dict[Any, set[str]] = {
                struct.tag: {inner.encode_name for inner in struct.fields} for struct in structs
            }
            found.append((field.encode_name, structs[0].tag_field, keys))
    return found
