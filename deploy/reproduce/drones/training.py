"""Trains what is not yet trained, several runs side by side, and evaluates it.

Runs are processes of ``swarm up``; stopped, they go on from their checkpoints when the same command
is given again.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import msgspec

from agent.config.experiment import load
from agent.storage.files import write_file
from deploy.policies.evaluate import evaluate
from deploy.policies.evaluation import Evaluation
from deploy.process.processes import end_all, last_line
from deploy.reproduce.claims import Say
from deploy.reproduce.drones.runs import Run, steps_per_round
from swarm.errors import SwarmError

POLL = 2.0  # [s]
STOP_LIMIT = 20.0  # [s] for a run to write its checkpoints


def train(runs: Iterable[Run], jobs: int, say: Say) -> None:
    """Bring every run to its last round.

    Args:
        runs: all of them; finished ones are left as they are.
        jobs: so many agents at a time, or one run if it has more.
        say: tells how far it is.

    Raises:
        SwarmError: a run failed; its own last line says why.  Or it was begun for another number
            of rounds and its step has fallen since, so that going on is not what was asked for.
    """
    everything = list(runs)
    for run in everything:
        _check_schedule(run)
    waiting = [run for run in everything if not run.finished]
    running: dict[subprocess.Popen[bytes], Run] = {}
    clock = _Clock(waiting)
    try:
        while waiting or running:
            busy = sum(len(run.config.members) for run in running.values())
            while waiting and (not running or busy + len(waiting[0].config.members) <= jobs):
                run = waiting.pop(0)
                running[_start(run)] = run
                busy += len(run.config.members)
            for process in [p for p in running if p.poll() is not None]:
                run = running.pop(process)
                if not run.finished:
                    raise SwarmError(f"{run.label}: {last_line(_log(run))}")
            say(clock.line(running.values()), clock.share)
            time.sleep(POLL)
    finally:
        end_all(running, STOP_LIMIT)


def assess(runs: Iterable[Run], flights: int, jobs: int, say: Say) -> None:
    """Fly every run that has not been flown with as many flights."""
    for run in runs:
        path = run.folder.evaluation
        if path.exists():
            kept = msgspec.json.decode(path.read_bytes(), type=Evaluation)
            if all(cell.flights >= flights for cells in kept.cells.values() for cell in cells):
                continue
        say(f"{run.label}: flying")
        result = evaluate(
            run.folder.path,
            flights=flights,
            jobs=jobs,
            show=lambda cell, share, run=run: say(f"{run.label}: flying {cell}, {share:.0%}"),  # type: ignore[misc]
        )
        write_file(path, msgspec.json.format(msgspec.json.encode(result), indent=2))


class _Clock:
    """The steps of all runs: how many there are, and how many a second."""

    def __init__(self, runs: list[Run]) -> None:
        self._runs = runs
        self._total = sum(
            run.config.rounds * steps_per_round(run.config) * len(run.config.members)
            for run in runs
        )
        self._start, self._first = time.monotonic(), self._steps()

    def _steps(self) -> int:
        return sum(run.steps for run in self._runs)

    @property
    def share(self) -> float | None:
        """Of the steps that were left at the start."""
        left = self._total - self._first
        return (self._steps() - self._first) / left if left else None

    def line(self, running: Iterable[Run]) -> str:
        steps = self._steps()
        names = ", ".join(f"{run.label} {_share(run):.0%}" for run in running)
        elapsed, done = time.monotonic() - self._start, steps - self._first
        if done <= 0:
            return names
        return f"{names}; {done / elapsed:.0f} steps/s"


def _check_schedule(run: Run) -> None:
    """Raises what :func:`train` says of the number of rounds."""
    if not run.begun:
        return
    begun, asked = load(run.folder.config), run.config
    constant = (1 - asked.optimizer.decay) * min(begun.rounds, asked.rounds)
    if begun.rounds != asked.rounds and run.newest > constant:
        raise SwarmError(
            f"{run.folder.path}: begun for {begun.rounds} rounds, and its step has fallen since; "
            f"--budget asks for {asked.rounds}: expected another --runs, or --budget "
            f"{begun.rounds * steps_per_round(begun)}"
        )


def _share(run: Run) -> float:
    total = run.config.rounds * steps_per_round(run.config) * len(run.config.members)
    return run.steps / total


def _log(run: Run) -> Path:
    return run.folder.path.with_suffix(".log")


def _start(run: Run) -> subprocess.Popen[bytes]:
    folder = run.folder.path
    folder.parent.mkdir(parents=True, exist_ok=True)
    if run.begun:
        run.folder.evaluation.unlink(missing_ok=True)
        order = ["up", "--resume", str(folder), "--set", f"rounds={run.config.rounds}"]
    else:
        file = folder.with_suffix(".json")
        write_file(file, msgspec.json.format(msgspec.json.encode(run.config), indent=2))
        order = ["up", str(file), "--run", str(folder), "--no-record"]
    with _log(run).open("ab") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "deploy.cli", *order],
            stdout=log,
            stderr=log,
            stdin=subprocess.DEVNULL,
            env=os.environ | {"COLUMNS": "120"},
        )
