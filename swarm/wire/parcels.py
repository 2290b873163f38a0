"""Large bodies on their way to several neighbours: copied once, into shared memory.

Zenoh moves a message to a process of the same machine through /dev/shm, but copies it anew for each
receiver unless the sender has put it there itself.  :class:`Parcels` does that, in a pool of its
own that is made with the first large body and freed as the receivers let go.  To another machine
the same parcel travels as bytes.
"""

import logging

import zenoh
from zenoh import shm

from swarm.wire.allocator import keep_freed_memory

log = logging.getLogger(__name__)
LARGE = 32_768  # [bytes] below, a message fits a packet of Zenoh's and is as fast without
BODIES = 4  # in the pool: this round's and the last one's, twice over for slow receivers


def unwrap(parcel: zenoh.ZBytes) -> bytes:
    """The bytes of what was received; shared memory is read at once, for it will be used again."""
    shared = parcel.as_shm()
    # Not to_bytes(): in zenoh 1.10 that clears the new bytes before it copies, half as much again.
    return parcel.to_bytes() if shared is None else bytes(shared)


class Parcels:
    """Wraps bodies for sending.

    Args:
        shared_memory: whether to use it at all.
    """

    def __init__(self, shared_memory: bool) -> None:
        self._shared_memory = shared_memory
        self._provider: shm.ShmProvider | None = None
        self._size = 0
        self._said = False  # that there was no room

    def wrap(self, body: bytes | bytearray) -> zenoh.ZBytes:
        """``body`` as something that can be sent to many at the cost of one copy."""
        if len(body) >= LARGE:
            keep_freed_memory()
        if self._shared_memory and len(body) >= LARGE:
            try:
                return self._share(body)
            except zenoh.ZError as error:  # a pool that stuck receivers hold, no room in /dev/shm
                if not self._said:
                    log.info("%d bytes without shared memory (%s; said once)", len(body), error)
                self._said = True
        return zenoh.ZBytes(body)

    def _share(self, body: bytes | bytearray) -> zenoh.ZBytes:
        if self._provider is None or self._size != len(body):
            self._size = len(body)
            room = BODIES * (self._size + 4096)
            self._provider = shm.ShmProvider.default_backend(room)
        buffer = self._provider.alloc(self._size, shm.GarbageCollect())
        buffer[0 : self._size] = body
        return zenoh.ZBytes(buffer)
