"""What lies beside a swarm file: files that its tasks read, modules that they come from.

Paths in a swarm file count from the file, as its certificates do, then from the working folder.
Once loaded they are absolute, so that a run can go on from anywhere.  A file that came over the
network is given neither (:mod:`agent.daemon.joining`).

Interface: :func:`located` for the arguments of a task; :func:`modules_of`, :func:`missing` and
:func:`look_in` for the modules that tasks name.
"""

import re
import sys
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_MODULE = re.compile(r"([A-Za-z_]\w*)(?:\.\w+)*:[A-Za-z_][\w-]*")  # mytasks:Lift-v0, body:make


def located(value: Any, folders: Iterable[Path]) -> Any:
    """A task's arguments with every relative path of a file that is in a folder made absolute.

    A string is taken for a path if it has a folder or a suffix and such a file exists.
    """
    folders = tuple(folders)
    if isinstance(value, dict):
        return {key: located(inner, folders) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [located(inner, folders) for inner in value]
    if isinstance(value, str) and ("/" in value or Path(value).suffix):
        for folder in folders:
            if (file := folder / value).is_file():
                return str(file.resolve())
    return value


def modules_of(tasks: Iterable[Any]) -> set[str]:
    """Top-level modules that tasks (ids and arguments) name as ``module:name``."""
    return {found[1] for text in strings(list(tasks)) if (found := _MODULE.fullmatch(text))}


def missing(names: Iterable[str]) -> bool:
    """Whether Python does not find all of the modules by itself."""
    return not all(_installed(name) for name in names)


def look_in(folders: Iterable[str]) -> None:
    """Have Python look for modules in folders, too.

    They come last in ``sys.path``: nothing in them hides what is installed.
    """
    sys.path += [folder for folder in folders if folder not in sys.path]


def _installed(name: str) -> bool:
    try:
        return name in sys.modules or find_spec(name) is not None
    except ValueError:  # a module without a spec: it is there
        return True


def strings(value: Any) -> Iterator[str]:
    """All strings in a task's arguments, keys of tables included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from (key, *strings(inner))
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from strings(inner)
