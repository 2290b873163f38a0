"""Measuring on a busy machine: CPU time, best of several rounds."""

import time
from collections.abc import Callable

import numpy as np

ROUNDS = 5


def cpu_seconds(work: Callable[[], None], rounds: int = ROUNDS) -> float:
    """The least CPU time that `work` took."""
    best = np.inf
    for _ in range(rounds):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return float(best)
