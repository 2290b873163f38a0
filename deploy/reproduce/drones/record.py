"""What is kept of the runs of an estimator: flights and learning curves, as in the study's JSON.

A record needs no run folders.  So estimators can learn on different machines, or before, and one
table shows them all (``swarm reproduce drones --beside FILE``).
"""

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from agent.storage.runfolder import RunFolder
from deploy.policies.evaluation import MODES, Cell, Evaluation, Mode
from deploy.reproduce.drones.runs import SWARM, Run
from sim.indoor.content.scenes import NAMES
from swarm.errors import ConfigError

POINTS = 30  # of a curve
Curve = tuple[list[float], list[float]]  # steps, mean safe flight [m]
Matrix = NDArray[np.float64]


class RunRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is kept of one run.

    Attributes:
        policy: name of the run, ``dcpg`` or ``sa-0`` to ``sa-3``.
        seed: its seed.
        steps: environment steps of all its agents.
        seconds: wall time of its rounds [s].
        rounds: how many.
        step: Adam's, in the first round.
        flights: how far the policy flies, by world.
        curves: how far its agents flew while they learned, by agent.
    """

    policy: str
    seed: int
    steps: int
    seconds: float
    rounds: int
    step: float
    flights: dict[str, list[Cell]]
    curves: dict[str, Curve]

    def mean(self, world: str, mode: Mode) -> float:
        """Mean safe flight [m].

        Raises:
            ConfigError: it was not flown so.
        """
        for cell in self.flights.get(world, ()):
            if cell.mode == mode:
                return cell.mean
        raise ConfigError(f"{self.policy}, seed {self.seed}: no {mode} flights in {world}")


class Made(msgspec.Struct, frozen=True):
    """Where a record comes from; of a study's provenance, what a reader of many records needs."""

    date: str
    commit: str | None
    machine: str

    def __str__(self) -> str:
        return f"{self.date}, commit {self.commit}, machine {self.machine}"


class Record(msgspec.Struct, frozen=True):
    """What is kept of an estimator: its runs, seed by seed, the swarm first."""

    runs: list[RunRecord]
    made: Made | None = None

    @property
    def seeds(self) -> list[int]:
        """Of all runs, each once."""
        return list(dict.fromkeys(run.seed for run in self.runs))

    @property
    def policies(self) -> list[str]:
        """Names of the runs of a seed, the swarm last, as the paper's table has them."""
        swarm, *alone = dict.fromkeys(run.policy for run in self.runs)
        return [*alone, swarm]

    def run(self, policy: str, seed: int) -> RunRecord:
        """One run.

        Raises:
            ConfigError: there is none.
        """
        for run in self.runs:
            if (run.policy, run.seed) == (policy, seed):
                return run
        raise ConfigError(f"no run {policy} of seed {seed}")

    def matrices(self, mode: Mode) -> Matrix:
        """(seeds, policies, worlds) mean safe flights [m], trained worlds first."""
        return np.array(
            [
                [[self.run(name, seed).mean(world, mode) for world in NAMES]
                 for name in self.policies]
                for seed in self.seeds
            ]
        )  # fmt: skip


def record(run: Run) -> RunRecord:
    """Of a run that has been trained and flown."""
    evaluation = msgspec.json.decode(run.folder.evaluation.read_bytes(), type=Evaluation)
    return RunRecord(
        policy=run.name,
        seed=run.config.seed,
        steps=run.steps,
        seconds=round(run.seconds, 1),
        rounds=run.config.rounds,
        step=run.config.optimizer.step,
        flights=evaluation.cells,
        curves={agent: curve(run.folder, agent) for agent in run.config.members},
    )


def curve(folder: RunFolder, agent: str) -> Curve:
    """Mean safe flight while learning: every point is the mean of a thirtieth of the run."""
    reports = [r for r in folder.reports(agent) if r.distance is not None]
    pieces = np.array_split(np.arange(len(reports)), min(POINTS, len(reports)))
    steps = [float(reports[piece[-1]].steps) for piece in pieces]
    lengths = [float(np.mean([reports[i].distance or 0.0 for i in piece])) for piece in pieces]
    return steps, lengths


class _File(msgspec.Struct, frozen=True):
    """Of a study's JSON, what is read again."""

    made: Made
    data: dict[str, Record]


def read(path: Path) -> dict[str, Record]:
    """The records of a ``drones.json``, by estimator.

    Raises:
        ConfigError: the file cannot be read, or is none.
    """
    try:
        file = msgspec.json.decode(path.read_bytes(), type=_File)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except msgspec.MsgspecError as error:
        raise ConfigError(f"{path}: {error}: expected what this command wrote") from None
    return {
        name: one if one.made else msgspec.structs.replace(one, made=file.made)
        for name, one in file.data.items()
    }


def check(found: Record, asked: Sequence[Sequence[Run]], flights: int) -> None:
    """That a record is of the runs that are asked for.

    Args:
        found: the record.
        asked: the runs, seed by seed.
        flights: per policy, world and mode.

    Raises:
        ConfigError: it is of others.
    """
    try:
        _check(found, [run for five in asked for run in five], flights)
    except ConfigError as error:
        raise ConfigError(f"--beside, {asked[0][0].estimator}: {error}") from None


def _check(found: Record, asked: Sequence[Run], flights: int) -> None:
    seeds = list(dict.fromkeys(run.config.seed for run in asked))
    if found.seeds != seeds:
        raise ConfigError(f"seeds {found.seeds}: expected {seeds}, of --seeds")
    for run in asked:
        kept, rounds = found.run(run.name, run.config.seed), run.config.rounds
        if kept.rounds != rounds:
            raise ConfigError(
                f"{run.name} has {kept.rounds} rounds: expected {rounds}, of --budget"
            )
        if list(kept.curves) != list(run.config.members):
            raise ConfigError(f"{run.name} has curves of {list(kept.curves)}: expected its agents'")
        fewest = min((cell.flights for cells in kept.flights.values() for cell in cells), default=0)
        if fewest < flights:
            raise ConfigError(f"{run.name} has {fewest} flights: expected {flights}, of --flights")
    if found.policies[-1] != SWARM:
        raise ConfigError(f"the first run is {found.policies[-1]}: expected {SWARM}")
    for mode in MODES:
        found.matrices(mode)
