"""Files that are there whole or not at all, also after a power cut.

Interface: :func:`write_file` for bytes, :func:`drafted` for what a library writes by name.  A file
is written beside its final name, brought to the disk, renamed, and its folder brought to the disk.
"""

import contextlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def drafted(path: Path, *, durable: bool = True) -> Iterator[Path]:
    """A name to write to, which becomes ``path`` at the end of the block; nothing if that fails.

    Args:
        path: the final name; the draft has the same ending.
        durable: bring it to the disk.  Otherwise it outlives its process, but after a power cut it
            may be torn.

    Raises:
        OSError: the disk refuses.
    """
    draft = path.with_name(f"{path.stem}.draft{path.suffix}")
    try:
        yield draft
        if durable:
            _sync(draft)
        draft.replace(path)
        if durable:
            _sync(path.parent)
    except BaseException:
        with contextlib.suppress(OSError):
            draft.unlink(missing_ok=True)
        raise


def write_file(path: Path, data: bytes, *, durable: bool = True, mode: int = 0o666) -> None:
    """Write a file with these permissions, less the umask; else as :func:`drafted`."""
    with drafted(path, durable=durable) as draft:
        draft.unlink(missing_ok=True)  # a draft that somebody left, with whatever permissions
        handle = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
        with os.fdopen(handle, "wb") as file:
            file.write(data)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
