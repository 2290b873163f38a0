"""The runs of the drone experiment: for each estimator and seed a swarm and four agents alone.

Every run is a swarm like any other; an agent alone is a swarm of one.  All runs take the same
number of environment steps per agent.  A swarm of N moves by the mean of its agents' steps, so its
step is N times that of an agent alone: the objective is the sum over the tasks, not their mean.
"""

from dataclasses import dataclass
from pathlib import Path

import msgspec

from agent.config.experiment import SwarmFile, load
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder
from deploy.library import SWARMS, find
from swarm.reports.telemetry import RoundReport

ESTIMATORS = ("reinforce", "a2c", "ppo")
SWARM = "dcpg"
STEP_ALONE = 1e-4  # the paper's


@dataclass(frozen=True)
class Run:
    """One training run.

    Attributes:
        estimator: its kind.
        name: ``dcpg``, or ``sa-0`` to ``sa-3`` for an agent alone.
        folder: where it lives.
        config: what is run.
    """

    estimator: str
    name: str
    folder: RunFolder
    config: SwarmFile

    @property
    def label(self) -> str:
        """Its name for people."""
        return f"{self.estimator} {self.name} seed {self.config.seed}"

    @property
    def begun(self) -> bool:
        """Whether there is something to resume."""
        return self.folder.config.exists()

    @property
    def newest(self) -> int:
        """The round that every agent has a checkpoint of, or of a later one; 0 without any."""
        members = self.config.members
        held = [checkpoint.rounds_in(self.folder.checkpoints(agent)) for agent in members]
        return min(max(rounds, default=0) for rounds in held)

    @property
    def finished(self) -> bool:
        """Whether every agent has played all rounds."""
        return self.begun and self.newest >= self.config.rounds

    @property
    def steps(self) -> int:
        """Environment steps so far, all agents together."""
        return sum(
            report.steps for agent in self.config.members if (report := last(self.folder, agent))
        )

    @property
    def seconds(self) -> float:
        """Wall time of the slowest agent's rounds so far [s], pauses left out."""
        return max(sum(r.seconds for r in self.folder.reports(a)) for a in self.config.members)


def last(folder: RunFolder, agent: str) -> RoundReport | None:
    """An agent's newest report, without reading all of them."""
    path = folder.metrics(agent)
    if not path.exists():
        return None
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 20_000))
        lines = file.read().splitlines()
    for line in reversed(lines):
        try:
            return msgspec.json.decode(line, type=RoundReport)
        except msgspec.MsgspecError:
            continue
    return None


def steps_per_round(config: SwarmFile) -> int:
    """Environment steps of one agent in a round, on average."""
    return config.training.worlds * config.training.segment


def plan(root: Path, estimator: str, budget: int, seed: int) -> list[Run]:
    """The five runs of an estimator and a seed, the swarm first.

    Args:
        root: folder of all runs.
        estimator: its kind.
        budget: environment steps of every agent; at least so many are taken.
        seed: of all of them.
    """
    whole = load(find(Path(f"drones-{estimator}"), SWARMS))
    rounds = -(-budget // steps_per_round(whole))
    whole = msgspec.structs.replace(whole, rounds=rounds, seed=seed)
    optimizer = msgspec.structs.replace(whole.optimizer, step=STEP_ALONE)
    alone = [
        msgspec.structs.replace(
            whole, name=f"sa-{i}-{estimator}", agents=(agent,), optimizer=optimizer
        )
        for i, agent in enumerate(whole.agents)
    ]
    names = [SWARM, *(f"sa-{i}" for i in range(len(alone)))]
    return [
        Run(estimator, name, RunFolder(root / f"seed{seed}" / estimator / name), config)
        for name, config in zip(names, [whole, *alone], strict=True)
    ]
