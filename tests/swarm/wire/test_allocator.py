"""The heaps of a process with many threads, counted by the C library itself."""

import subprocess
import sys

from swarm.wire.allocator import ARENAS

PROGRAM = """
import ctypes, sys, threading
from swarm.wire.allocator import share_arenas
if sys.argv[1] == "shared":
    share_arenas()
library = ctypes.CDLL(None)
library.malloc.restype = ctypes.c_void_p
together = threading.Barrier(8)
def take():
    library.malloc(1000)
    together.wait(10)
threads = [threading.Thread(target=take) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
library.malloc_stats()
"""


def arenas(how: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, how],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return done.stderr.count("Arena ")


def test_threads_share_arenas() -> None:
    assert arenas("shared") <= ARENAS < arenas("as it is")
