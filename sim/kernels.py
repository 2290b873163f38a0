"""How the worlds compile: numba's ``njit``, a cache that stays right, and a word while it compiles.

Each room that computes has one :class:`Kernels`, its decorator ``compiled``::

    compiled = Kernels(Path(__file__).parent, "indoor").compiled

The options are NumPy's division and a cache that is another one as soon as any compiled file of
the room changes (numba itself looks only at the file of the outermost function).  It lies under
``NUMBA_CACHE_DIR``, else under :func:`cache_dir`: the package may be read-only.  Compilation is
announced by :mod:`sim.notices`, where it takes long and where the cache has nothing to offer.
"""

import hashlib
import os
import stat
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast, overload

import numba
from numba.core import event

from sim.notices import Work

Function = TypeVar("Function", bound=Callable[..., Any])

COMPILE_SECONDS = 40  # measured, one core, all kernels of a flight; only for the announcement


def cache_dir() -> Path:
    """``$XDG_CACHE_HOME/dcpg-swarm``, else ``~/.cache/dcpg-swarm``; temporary if read-only."""
    base = os.environ.get("XDG_CACHE_HOME")
    folder = (Path(base) if base else Path.home() / ".cache") / "dcpg-swarm"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return _own_temporary()


def _own_temporary() -> Path:
    """A folder for this user among the temporary files.

    Compiled code is loaded from it, so one that another user made, or may write to, is not used.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"dcpg-swarm-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    state = folder.lstat()
    if stat.S_ISDIR(state.st_mode) and state.st_uid == user and not state.st_mode & 0o022:
        return folder
    return Path(tempfile.mkdtemp(prefix="dcpg-swarm-"))


class Kernels:
    """The compiled functions of one room.

    Args:
        room: folder of its sources.
        name: of its cache.
        also: files that hold no compiled function, but what such functions are compiled with.
    """

    def __init__(self, room: Path, name: str, also: Sequence[str] = ()) -> None:
        digest = hashlib.sha256()
        for file in sorted(room.rglob("*.py")):
            source = file.read_bytes()
            if b"@compiled" in source or file.name in also:
                digest.update(source)
        base = os.environ.get("NUMBA_CACHE_DIR") or cache_dir()
        self.folder = str(Path(base) / f"{name}-{digest.hexdigest()[:16]}")

    @overload
    def compiled(self, function: Function, /) -> Function: ...
    @overload
    def compiled(
        self, function: None = None, /, *, fastmath: set[str] | bool = ..., nogil: bool = ...
    ) -> Callable[[Function], Function]: ...
    def compiled(
        self,
        function: Function | None = None,
        /,
        *,
        fastmath: set[str] | bool = False,
        nogil: bool = False,
    ) -> Function | Callable[[Function], Function]:
        """``njit`` with this room's options.

        Args:
            function: what to compile.
            fastmath: the liberties that LLVM may take.
            nogil: let other threads go on; for what runs for seconds.
        """

        def decorate(function: Function) -> Function:
            config: Any = numba.config  # numba's own types do not know its settings
            before = config.CACHE_DIR
            config.CACHE_DIR = self.folder  # numba asks for it once, when a function is decorated
            try:
                kernel = numba.njit(
                    cache=True, error_model="numpy", fastmath=fastmath, nogil=nogil
                )(function)
            finally:
                config.CACHE_DIR = before
            return cast(Function, kernel)

        return decorate if function is None else decorate(function)


class _Announcer(event.Listener):
    """Tells why nothing seems to happen; kernels that call kernels compile within each other."""

    def __init__(self) -> None:
        self._work = Work(f"compiling the worlds' kernels, once, about {COMPILE_SECONDS} s")
        self._depth = 0

    def on_start(self, event: event.Event) -> None:
        self._depth += 1
        if self._depth == 1:
            self._work.begin()

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._work.end()


cast(Any, event).register("numba:compile", _Announcer())
