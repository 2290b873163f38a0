"""What a run leaves behind, and where.

::

    runs/NAME-DATE/
        config.json           the resolved swarm file
        versions.json         of Python and the packages that matter
        result.json           how it ended and what the final table shows
        eval.json             how far the learned policy flew (`swarm eval`)
        events.jsonl          what `swarm up` saw: faults, agents that ended or started again
        recording.rrd         for Rerun
        flown/drone0.jsonl    samples of its flights, see agent.storage.flights
        metrics/drone0.jsonl  one swarm.reports.telemetry.RoundReport a line
        checkpoints/drone0/00000042.safetensors
        logs/drone0.log
"""

import logging
import os
import platform
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import msgspec

from agent.config.experiment import SwarmFile
from agent.errors import CheckpointError
from agent.storage import checkpoint
from agent.storage.checkpoint import Checkpoint
from agent.storage.files import write_file
from swarm.errors import ConfigError
from swarm.reports.telemetry import RoundReport

log = logging.getLogger(__name__)
PACKAGES = ("dcpg-swarm", "eclipse-zenoh", "numpy", "torch", "gymnasium", "msgspec", "safetensors")


@dataclass(frozen=True, slots=True)
class RunFolder:
    """Paths of one run."""

    path: Path

    @property
    def config(self) -> Path:
        """The resolved swarm file."""
        return self.path / "config.json"

    @property
    def result(self) -> Path:
        """Numbers of the final table."""
        return self.path / "result.json"

    @property
    def evaluation(self) -> Path:
        """Flights of the learned policy."""
        return self.path / "eval.json"

    @property
    def events(self) -> Path:
        """Faults and restarts."""
        return self.path / "events.jsonl"

    @property
    def recording(self) -> Path:
        """For Rerun."""
        return self.path / "recording.rrd"

    def metrics(self, agent: str) -> Path:
        """Round reports of an agent."""
        return self.path / "metrics" / f"{agent}.jsonl"

    def flown(self, agent: str) -> Path:
        """Flight samples of an agent."""
        return self.path / "flown" / f"{agent}.jsonl"

    def checkpoints(self, agent: str) -> Path:
        """Folder of an agent's checkpoints."""
        return self.path / "checkpoints" / agent

    def log(self, agent: str) -> Path:
        """Log of an agent."""
        return self.path / "logs" / f"{agent}.log"

    def prepare(self, agent: str) -> None:
        """Make the folders that an agent writes to.

        Raises:
            ConfigError: they cannot be made.
        """
        try:
            for file in (self.metrics(agent), self.log(agent), self.checkpoints(agent) / "x"):
                file.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(
                f'run folder "{self.path}" cannot be made: {error.strerror}'
            ) from None

    def write_config(self, config: SwarmFile) -> None:
        """Keep the resolved configuration and the versions it ran with.

        Raises:
            ConfigError: they cannot be written.
        """
        versions = {"python": platform.python_version()}
        for package in PACKAGES:
            try:
                versions[package] = version(package)
            except PackageNotFoundError:
                continue
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            write_file(self.path / "versions.json", _pretty(versions))
            write_file(self.config, _pretty(config))
        except OSError as error:
            raise ConfigError(
                f'run folder "{self.path}" cannot be written: {error.strerror}'
            ) from None

    def newest(self, agent: str) -> Checkpoint:
        """An agent's newest checkpoint that reads.

        Raises:
            CheckpointError: it left none.
        """
        found = checkpoint.newest(self.checkpoints(agent))
        if found is None:
            raise CheckpointError(f"{agent} left no checkpoint; see {self.log(agent)}")
        return found

    def common_round(self, agents: tuple[str, ...], every: int = 1) -> int | None:
        """Newest round that every agent has a checkpoint of that reads; None without any.

        Round 0 needs no file: whoever has all of its checkpoints, or none, can begin there.

        Args:
            agents: which.
            every: rounds between checkpoints.
        """
        held = [set(checkpoint.rounds_in(self.checkpoints(agent))) for agent in agents]
        held = [rounds | {0} if min(rounds, default=0) <= every else rounds for rounds in held]
        for round_ in sorted(set.intersection(*held), reverse=True):
            if all(self._reads(agent, round_) for agent in agents):
                return round_
        return None

    def _reads(self, agent: str, round_: int) -> bool:
        if round_ == 0:
            return True
        try:
            checkpoint.read(checkpoint.path_of(self.checkpoints(agent), round_))
        except CheckpointError as error:
            log.warning("%s; passing over round %d", error, round_)
            return False
        return True

    def reports(self, agent: str) -> Iterator[RoundReport]:
        """Reports of an agent in order: of each round the last that reads."""
        decoder = msgspec.json.Decoder(RoundReport)
        by_round: dict[int, RoundReport] = {}
        if self.metrics(agent).exists():
            for line in self.metrics(agent).read_bytes().splitlines():
                try:
                    report = decoder.decode(line)
                except msgspec.MsgspecError:
                    continue
                by_round[report.round] = report
        for round_ in sorted(by_round):
            yield by_round[round_]


def _pretty(value: Any) -> bytes:
    return msgspec.json.format(msgspec.json.encode(value), indent=2)


def open_run(path: Path) -> RunFolder:
    """A run folder that exists.

    Raises:
        ConfigError: the path is not one.
    """
    folder = RunFolder(path)
    if not os.path.isfile(folder.config):  # noqa: PTH113  (Path's raises where it may not look)
        raise ConfigError(f'"{path}" is not a run folder: expected a folder with config.json')
    return folder
