"""How this room compiles: one decorator, its cache on disk, and a word while it compiles.

``@compiled`` is numba's ``njit`` with NumPy's division and a cache that stays right when any file
of this room changes (numba itself looks only at the file of the outermost function).  The cache
lies under ``cache_dir()``: the package may be read-only.  The first compilation of a process
says so on stderr, once, and only where the cache has nothing to offer.
"""

import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast, overload

import numba
from numba.core import event

Function = TypeVar("Function", bound=Callable[..., Any])

COMPILE_SECONDS = 30  # measured, one core; only for the announcement


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


def _kernels_dir() -> str:
    """One folder for each state of this room's compiled sources, also under NUMBA_CACHE_DIR."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        source = file.read_bytes()
        if b"@compiled" in source:
            digest.update(source)
    base = os.environ.get("NUMBA_CACHE_DIR") or cache_dir()
    return str(Path(base) / f"kernels-{digest.hexdigest()[:16]}")


class _Announcer(event.Listener):
    """Tells the user why nothing seems to happen."""

    def __init__(self) -> None:
        self.said = False

    def on_start(self, event: event.Event) -> None:
        name = event.data["dispatcher"].py_func.__module__
        if not self.said and name.startswith("sim.indoor"):
            self.said = True
            print(
                f"sim.indoor: compiling, once, about {COMPILE_SECONDS} s",
                file=sys.stderr,
                flush=True,
            )

    def on_end(self, event: event.Event) -> None:
        """Nothing to say."""


FOLDER = _kernels_dir()
cast(Any, event).register("numba:compile", _Announcer())


@overload
def compiled(function: Function, /) -> Function: ...
@overload
def compiled(*, fastmath: set[str]) -> Callable[[Function], Function]: ...
def compiled(
    function: Function | None = None, /, *, fastmath: set[str] | bool = False
) -> Function | Callable[[Function], Function]:
    """``njit`` with this room's options; `fastmath` names the liberties that LLVM may take."""

    def decorate(function: Function) -> Function:
        config: Any = numba.config
        before = config.CACHE_DIR
        config.CACHE_DIR = FOLDER  # numba asks for it once, when a function is decorated
        try:
            kernel = numba.njit(cache=True, error_model="numpy", fastmath=fastmath)(function)
        finally:
            config.CACHE_DIR = before
        return cast(Function, kernel)

    return decorate if function is None else decorate(function)
