"""What a process of ours that lives for Zenoh tells the C library and Zenoh about itself.

Interface: :func:`settle_process`, for the daemon, which owns its process; a library that opens a
session leaves its host as it is.  Numbers from mallopt(3); not all C libraries can be told, then
nothing happens.
"""

import ctypes
import os
from functools import cache

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8
ARENAS = 2
MAPPED = 32 << 20  # [bytes] blocks from here on are the kernel's in any case
KEPT = 64 << 20  # [bytes] free memory at most that is not given back


def settle_process() -> None:
    """All of it, before the first session is opened."""
    # Threads that close the sockets of lost peers block; with too few, losses are seen late.
    os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 8))")
    share_arenas()
    keep_freed_memory()


@cache
def share_arenas() -> None:
    """Have all threads that start from now on take memory from :data:`ARENAS` heaps.

    glibc gives a thread a heap of its own, up to eight times the cores.  Zenoh has more threads
    than that, and what a flood of messages took for a moment stays in every heap that it came
    through.  ``tests/integration/test_hostile_peer.py`` bounds what a flood may leave behind.
    """
    _tell(M_ARENA_MAX, ARENAS)


@cache
def keep_freed_memory() -> None:
    """Have the C library keep what large bodies free, for the next ones.

    It would give every freed vector back to the kernel, and take zeroed pages again a moment later:
    a tenth of an exchange of 5 MB.
    """
    _tell(M_MMAP_THRESHOLD, MAPPED)
    _tell(M_TRIM_THRESHOLD, KEPT)


def _tell(parameter: int, value: int) -> None:
    tell = getattr(ctypes.CDLL(None), "mallopt", None)
    if tell is not None:
        tell(parameter, value)
