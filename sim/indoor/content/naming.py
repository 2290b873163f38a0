"""What a world is called: ``indoor-long``, ``hall.glb``, ``hall.glb?open&starts=4,10,-1.5,3.1``.

Interface: :func:`split`, :func:`join`, :class:`FileOptions`.  How a file is to be read is part of
the world's name, so that whoever is told the name (a vehicle, the viewer) sees the same world.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from sim.indoor.errors import SceneError

Place = tuple[float, float, float, float]  # x, y, z [m, NED], yaw [rad]


@dataclass(frozen=True)
class FileOptions:
    """How a user's file becomes a world.

    Attributes:
        open: flights may get out; leaving the world's bounds is then a crash.
        starts: where flights start; none: places are looked for.
    """

    open: bool = False
    starts: tuple[Place, ...] = ()


AS_IT_IS = FileOptions()


def split(name: str) -> tuple[str, FileOptions]:
    """The file, or the name of one of our worlds, and the options behind the ``?``.

    Raises:
        SceneError: an option is none.
    """
    file, mark, query = name.partition("?")
    if not mark or Path(name).exists():
        return name, AS_IT_IS
    values: dict[str, Any] = {}
    for word in query.split("&"):
        key, given, value = word.partition("=")
        values[key] = value if given else True
    return file, _checked(values, name)


def join(name: str, options: Mapping[str, Any] | None) -> str:
    """The name with ``options`` in it: ``{"open": True}`` becomes ``?open``.

    Raises:
        SceneError: an option is none, or the name has some already.
    """
    if not options:
        return name
    if split(name)[1] != AS_IT_IS:
        raise SceneError(f"scene {name!r} has options already: expected them there, or beside it")
    checked = _checked(options, name)
    words = ["open"] if checked.open else []
    if checked.starts:
        words.append("starts=" + ";".join(",".join(map(repr, place)) for place in checked.starts))
    return f"{name}?{'&'.join(words)}" if words else name


def _checked(values: Mapping[str, Any], name: str) -> FileOptions:
    known = [field.name for field in fields(FileOptions)]
    if unknown := sorted(set(values) - set(known)):
        raise SceneError(f'scene {name!r}: unknown option "{unknown[0]}", expected {known}')
    return FileOptions(_flag(values.get("open", False), name), _places(values.get("starts"), name))


def _flag(value: Any, name: str) -> bool:
    if value in {"true", "false"}:
        return bool(value == "true")
    if isinstance(value, bool):
        return value
    raise SceneError(f"scene {name!r}: open = {value!r}, expected true or false")


def _places(value: Any, name: str) -> tuple[Place, ...]:
    if value is None:
        return ()
    try:
        rows = [row.split(",") for row in value.split(";")] if isinstance(value, str) else value
        return tuple((float(x), float(y), float(z), float(yaw)) for x, y, z, yaw in rows)
    except (TypeError, ValueError):
        raise SceneError(
            f"scene {name!r}: starts = {value!r}, expected x,y,z,yaw;... [m, NED; rad]"
        ) from None
