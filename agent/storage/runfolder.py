"""What a run leaves behind, and where.

::

    runs/NAME-DATE/
        config.json           the resolved swarm file
        versions.json         of Python and the packages that matter
        result.json           what the final table shows
        eval.json             how far the learned policy flew (`swarm eval`)
        events.jsonl          what `swarm up` saw: faults, agents that ended or started again
        recording.rrd         for Rerun
        metrics/drone0.jsonl  one swarm.reports.telemetry.RoundReport a line
        checkpoints/drone0/00000042.safetensors
        logs/drone0.log
"""

import platform
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec

from agent.config.experiment import SwarmFile
from agent.errors import CheckpointError
from agent.storage import checkpoint
from agent.storage.checkpoint import Checkpoint
from swarm.errors import ConfigError
from swarm.reports.telemetry import RoundReport

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
            raise ConfigError(f'run folder "{self.path}" cannot be made: {error}') from None

    def write_config(self, config: SwarmFile) -> None:
        """Keep the resolved configuration and the versions it ran with."""
        self.path.mkdir(parents=True, exist_ok=True)
        text = msgspec.json.format(msgspec.json.encode(config), indent=2)
        self.config.write_bytes(text)
        versions = {"python": platform.python_version()}
        for package in PACKAGES:
            try:
                versions[package] = version(package)
            except PackageNotFoundError:
                continue
        text = msgspec.json.format(msgspec.json.encode(versions), indent=2)
        (self.path / "versions.json").write_bytes(text)

    def newest(self, agent: str) -> Checkpoint:
        """An agent's newest checkpoint.

        Raises:
            CheckpointError: it left none, or one that does not read.
        """
        held = checkpoint.rounds_in(self.checkpoints(agent))
        if not held:
            raise CheckpointError(f"{agent} left no checkpoint; see {self.log(agent)}")
        return checkpoint.read(checkpoint.path_of(self.checkpoints(agent), held[-1]))

    def common_round(self, agents: tuple[str, ...]) -> int:
        """Newest round that every agent has a checkpoint of.

        Raises:
            CheckpointError: there is none.
        """
        held = [set(checkpoint.rounds_in(self.checkpoints(agent))) for agent in agents]
        common = set.intersection(*held)
        if not common:
            newest = ", ".join(
                f"{agent} {max(rounds, default='none')}"
                for agent, rounds in zip(agents, held, strict=True)
            )
            raise CheckpointError(
                f'run "{self.path}" has no round that all agents have a checkpoint of '
                f"(newest: {newest})"
            )
        return max(common)

    def reports(self, agent: str) -> Iterator[RoundReport]:
        """Reports of an agent in order; a torn last line is left out, of a round twice the last."""
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


def open_run(path: Path) -> RunFolder:
    """A run folder that exists.

    Raises:
        ConfigError: the path is not one.
    """
    folder = RunFolder(path)
    if not folder.config.is_file():
        raise ConfigError(f'"{path}" is not a run folder: expected a folder with config.json')
    return folder
