"""How this room compiles: ``@compiled`` is numba's ``njit``, cached on disk.

The cache lies beside the sources of one user (``~/.cache/dcpg-swarm``), in one folder per state of
the files that are compiled: numba itself looks only at that of the outermost function.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


SOURCES = ("airframe.py", "control.py", "dynamics.py", "frames.py")


def _folder() -> str:
    digest = hashlib.sha256()
    for name in SOURCES:
        digest.update(Path(__file__).with_name(name).read_bytes())
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dcpg-swarm"
    folder = base / f"vehicle-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:  # a read-only home
        return tempfile.mkdtemp(prefix="dcpg-swarm-vehicle-")
    return str(folder)


FOLDER = os.environ.get("NUMBA_CACHE_DIR") or _folder()


def compiled(function: Function) -> Function:
    """``njit`` with NumPy's division, kept in this room's cache."""
    settings: Any = numba.config  # numba's own types do not know its settings
    before = settings.CACHE_DIR
    settings.CACHE_DIR = FOLDER
    try:
        return cast("Function", numba.njit(cache=True, error_model="numpy")(function))
    finally:
        settings.CACHE_DIR = before
