"""Ending processes that we started, and what they said last."""

import subprocess
import time
from collections.abc import Iterable
from pathlib import Path


def end_all(processes: Iterable[subprocess.Popen[bytes]], limit: float) -> None:
    """End every process that runs: SIGTERM, then SIGKILL after ``limit`` seconds."""
    running = [process for process in processes if process.poll() is None]
    for process in running:
        process.terminate()
    end = time.monotonic() + limit
    for process in running:
        try:
            process.wait(max(0.0, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def last_line(log: Path) -> str:
    """The last line of a log, without the command's name."""
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1].removeprefix("swarm: ") if lines else "it said nothing"
