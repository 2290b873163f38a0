"""Large bodies on their way to processes of the same machine: copied once, into shared memory.

Zenoh moves a message to a process of the same machine through /dev/shm, but copies it anew for each
receiver unless the sender has put it there itself.  :class:`SharedMemory` does that, in a pool of
its own that is made with the first large body and freed as the receivers let go.
"""

import os
import threading
from pathlib import Path

import zenoh
from zenoh import shm

from swarm.wire.buffers import Body

BODIES = 4  # in the pool: this round's and the last one's, twice over for slow receivers


def unwrap(payload: zenoh.ZBytes) -> tuple[bytes, bool]:
    """What was received, and whether it came through shared memory.

    Shared memory is read at once, for it will be used again.
    """
    shared = payload.as_shm()
    # Not to_bytes(): in zenoh 1.10 that clears the new bytes before it copies, half as much again.
    return (payload.to_bytes(), False) if shared is None else (bytes(shared), True)


def machine() -> str:
    """Name of the memory that processes share here: others have the same name or no access to it.

    Containers of one kernel have a /dev/shm each; network namespaces have the same one.
    """
    try:
        kernel = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{kernel[:32]}.{os.stat('/dev/shm').st_dev}"  # noqa: PTH116, S108
    except OSError:
        return ""


class SharedMemory:
    """Bodies that several neighbours get at the cost of one copy; for several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._provider: shm.ShmProvider | None = None
        self._size = 0
        self._newest: tuple[Body, zenoh.ZBytes] | None = None

    def wrap(self, body: Body) -> zenoh.ZBytes:
        """``body`` in shared memory.

        Raises:
            zenoh.ZError: there is no room; stuck receivers hold the pool, or /dev/shm is full.
        """
        with self._lock:
            if self._newest is None or self._newest[0] is not body:
                self._newest = (body, self._copy(body))
            return self._newest[1]

    def _copy(self, body: Body) -> zenoh.ZBytes:
        if self._provider is None or self._size != len(body):
            self._size = len(body)
            self._provider = shm.ShmProvider.default_backend(BODIES * (self._size + 4096))
        buffer = self._provider.alloc(self._size, shm.GarbageCollect())
        buffer[0 : self._size] = body
        return zenoh.ZBytes(buffer)
