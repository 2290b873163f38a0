"""Real swarms for tests: start, watch and end the command line's own processes."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import IO, Any

import numpy as np

from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder
from deploy.process.ports import Ports, hold_free
from swarm.wire.frames import Chunk, encode
from tests.notices import without_notices

ROOT = Path(__file__).parents[2]
SWARMS = ROOT / "deploy" / "library" / "swarms"
GRIDWORLD_A = SWARMS / "gridworld-a.toml"
MEMBERS = ("drone0", "drone1", "drone2", "drone3")
PATIENCE = 60.0  # [s] a loaded machine may be slow; nothing here is a measurement


def until(condition: Callable[[], bool], what: str, deadline: float = PATIENCE) -> None:
    """Wait for a condition; fail with its name when it does not come true."""
    end, pause = time.monotonic() + deadline, threading.Event()
    while not condition():
        assert time.monotonic() < end, f"{what} did not happen within {deadline:.0f} s"
        pause.wait(0.02)


_HELD: list[Ports] = []  # until the tests end


def free_base_port(count: int) -> int:
    """First of ``count`` ports in a row that nobody else uses, or chooses, while the tests run."""
    _HELD.append(hold_free("127.0.0.1", count))
    return _HELD[-1].numbers[0]


@dataclass
class Command:
    """A running ``swarm ...`` command; its lines are collected as they come.

    Attributes:
        process: it.
        printed: lines of its standard output.
        told: lines of its standard error.
    """

    process: subprocess.Popen[str]
    printed: list[str] = field(default_factory=list)
    told: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        assert self.process.stdout is not None
        assert self.process.stderr is not None
        pipes = (self.process.stdout, self.printed), (self.process.stderr, self.told)
        self._readers = [threading.Thread(target=_read, args=pipe, daemon=True) for pipe in pipes]
        for reader in self._readers:
            reader.start()

    @property
    def answer(self) -> str:
        """What it has printed."""
        return "\n".join(self.printed)

    @property
    def output(self) -> str:
        """What it has printed, then what it has told, of which a mistake is the last line."""
        return "\n".join((*self.printed, *self.told))

    def wait(self, deadline: float = PATIENCE) -> int:
        """Exit code."""
        code = self.process.wait(deadline)
        for reader in self._readers:
            reader.join(5.0)
        return code

    def says(self, text: str, deadline: float = PATIENCE) -> None:
        """Wait until a line contains ``text``."""
        until(lambda: text in self.output, f'"{text}" in:\n{self.output}\n', deadline)

    def interrupt(self) -> None:
        self.process.send_signal(signal.SIGINT)


def _read(pipe: IO[str], lines: list[str]) -> None:
    for line in pipe:
        lines.append(line.rstrip("\n"))


@contextmanager
def swarm(*arguments: str | Path, cwd: Path) -> Iterator[Command]:
    """Run ``swarm`` with these arguments; ended at the end whatever happens."""
    process = subprocess.Popen(
        [sys.executable, "-m", "deploy.cli", *map(str, arguments)],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "160"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield Command(process)
    finally:
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def run(*arguments: str | Path, cwd: Path, deadline: float = PATIENCE) -> tuple[int, str]:
    """Run ``swarm`` to its end: (exit code, output without notices)."""
    with swarm(*arguments, cwd=cwd) as command:
        return command.wait(deadline), without_notices(command.output)


def ask(*arguments: str | Path, cwd: Path) -> tuple[int, Any]:
    """Run ``swarm ... --json`` to its end: (exit code, what it printed)."""
    with swarm(*arguments, "--json", cwd=cwd) as command:
        code = command.wait()
        assert command.printed, command.output
        return code, json.loads(command.answer)


def status(folder: Path, cwd: Path, timeout: float = 5.0) -> tuple[int, dict[str, Any]]:
    """``swarm status --json``: (exit code, what it said)."""
    return ask("status", folder, "--timeout", str(timeout), cwd=cwd)


def final_thetas(folder: Path, agents: tuple[str, ...] = MEMBERS) -> np.ndarray:
    """(N, d) parameters of each agent's newest checkpoint."""
    run_folder, thetas = RunFolder(folder), []
    for agent in agents:
        held = run_folder.checkpoints(agent)
        path = checkpoint.path_of(held, checkpoint.rounds_in(held)[-1])
        thetas.append(checkpoint.read(path).theta)
    return np.stack(thetas)


def rounds_played(folder: Path, agent: str) -> int:
    """Lines of an agent's metrics file."""
    path = RunFolder(folder).metrics(agent)
    return path.read_bytes().count(b"\n") if path.exists() else 0


def agent_pids(folder: Path) -> dict[str, int]:
    """Process ids of the agents that run for a folder, from /proc."""
    pids = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            words = (entry / "cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if "--supervised" in words and words[words.index("--run") + 1] == str(folder):
            pids[words[words.index("--id") + 1]] = int(entry.name)
    return pids


_streams = count(1000)


def framed(agent: str, life: str, header: bytes, body: bytes) -> bytes:
    """The attachment of a message that is the first, and the last, of a stream of its own."""
    stream, kind = next(_streams), "round" if body else "beat"
    return encode(Chunk(agent, life, stream, 0, 0, kind, 0, len(body), False, 0.0, header))
