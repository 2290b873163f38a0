"""Swarm files, faults and policies that come with the package, found by name.

Interface: :func:`find` wherever a file of one of the :data:`KINDS` is expected, :func:`entries` and
:func:`named` for who looks around.  A path to something that exists wins; a name without folder or
ending is looked up here.  A new file needs no more than to lie in its folder; what it is about
stands in its first comment, of a policy in its header.
"""

import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from swarm.errors import ConfigError

HERE = Path(__file__).parent
LIST = '"swarm library" lists them'
LINE = re.compile(r"^#\s?(.*)$")


@dataclass(frozen=True)
class Kind:
    """One of the library's folders.

    Attributes:
        folder: its name.
        suffix: of its files.
        one: what one of them is called.
    """

    folder: str
    suffix: str
    one: str


SWARMS = Kind("swarms", ".toml", "swarm file")
FAULTS = Kind("faults", ".toml", "chaos file")
POLICIES = Kind("policies", ".safetensors", "policy")
KINDS = (SWARMS, FAULTS, POLICIES)


def entries(kind: Kind) -> list[Path]:
    """The files of a kind, by name."""
    return sorted((HERE / kind.folder).glob(f"*{kind.suffix}"))


def named(name: str) -> list[Path]:
    """All files of that name, with or without its ending, of whatever kind.

    Raises:
        ConfigError: there is none.
    """
    found = [path for path in _all() if name in (path.stem, path.name)]
    if not found:
        raise ConfigError(f'the library has no "{name}"{_near(name, _all())}: {LIST}')
    return found


def find(path: Path, kind: Kind) -> Path:
    """What a user means by ``path``: itself, if it exists, else the file of that name in here.

    Raises:
        ConfigError: it is a name, and there is none like it.
    """
    if path.exists() or len(path.parts) != 1 or path.suffix:
        return path
    for entry in entries(kind):
        if entry.stem == path.name:
            return entry
    beside = path.with_suffix(kind.suffix)
    guess = f' (did you mean "{beside}"?)' if beside.exists() else _near(path.name, entries(kind))
    raise ConfigError(f'no {kind.one} "{path}"{guess}: expected a path or a name; {LIST}')


def about(path: Path) -> str:
    """The first sentence of the comment with which a TOML file begins."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if (match := LINE.match(line)) is None:
            break
        lines.append(match[1])
    return re.split(r"(?<=\.)\s", " ".join(lines), maxsplit=1)[0]


def _all() -> Iterator[Path]:
    for kind in KINDS:
        yield from entries(kind)


def _near(name: str, among: Iterator[Path] | list[Path]) -> str:
    known = sorted({path.stem for path in among})
    near = difflib.get_close_matches(name, known, n=3)
    near += [other for other in known if name and name in other and other not in near]
    return f" (did you mean {' or '.join(near[:3])}?)" if near else ""
