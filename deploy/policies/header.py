"""What an exported policy says about itself: the header of its file, readable without PyTorch.

Interface: :class:`Header`, :func:`header_of`, :func:`notes`.  It is one entry, JSON, of the
metadata of a safetensors file, beside what the network is built from, or of an ONNX model's
properties.
"""

import os
from pathlib import Path

import msgspec
import numpy as np
from safetensors import SafetensorError, safe_open

from agent.config.experiment import Task
from agent.errors import CheckpointError
from deploy.policies.evaluation import MODES, Cell, Mode

KEY = "header"


class Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where a policy comes from, what it wants and gives, and how far it flies.

    Attributes:
        swarm: name of the swarm that learned it.
        estimator: how.
        agent: whose parameters; None for the mean of all.
        worlds: in which it learned, one an agent.
        observations: what goes in.
        actions: what comes out, and what it means.
        seed: of the run.
        rounds: of the run.
        steps: in the environments, all agents together.
        licence: SPDX expression; empty: none is stated.
        date: of the run, or of the export (ISO 8601).
        software: what wrote it.
        measure: of ``flights``: "m" or "return".
        flights: how it did when it was measured (``swarm eval``), by world.
    """

    swarm: str
    estimator: str
    agent: str | None
    worlds: tuple[Task, ...]
    observations: str
    actions: str
    seed: int
    rounds: int
    steps: int
    licence: str
    date: str
    software: str
    measure: str = "m"
    flights: dict[str, list[Cell]] = {}

    def title(self) -> str:
        """One line."""
        whose = f"{self.agent} of {self.swarm}" if self.agent else self.swarm
        line = f"{self.estimator}, learned by {whose} in {len(self.worlds)} worlds"
        return f"{line}; {self._means()}" if self.flights else line

    def lines(self) -> list[str]:
        """All of it, for people."""
        whose = f"agent {self.agent}" if self.agent else "mean of all agents"
        told = [
            f"swarm         {self.swarm}, {self.estimator}, {whose}",
            f"learned       {self.rounds:,} rounds, {self.steps:,} steps, seed {self.seed}",
            f"in            {'; '.join(dict.fromkeys(_name(task) for task in self.worlds))}",
            f"observations  {self.observations}",
            f"actions       {self.actions}",
            f"licence       {self.licence or 'not stated'}",
            f"made          {self.date}, {self.software}",
        ]
        unit = "m" if self.measure == "m" else "reward"
        for world, cells in self.flights.items():
            said = ", ".join(
                f"{cell.mode} {cell.mean:.1f} ± {cell.deviation:.1f} {unit} (of {cell.flights})"
                for cell in cells
            )
            told.append(f"flights       {world}: {said}")
        return told

    def _means(self) -> str:
        def mean(mode: Mode) -> float:
            cells = [cell for cells in self.flights.values() for cell in cells]
            return float(np.mean([cell.mean for cell in cells if cell.mode == mode]))

        unit = " m" if self.measure == "m" else ""
        said = " and ".join(f"{mean(mode):.0f}{unit} {mode}" for mode in MODES)
        return f"flies {said}, mean of {len(self.flights)} worlds"


def header_of(path: Path) -> Header | None:
    """The header of a policy's file; None where it has none.

    Raises:
        CheckpointError: it is not such a file.
    """
    try:
        with safe_open(os.fspath(path), framework="numpy") as file:
            text = (file.metadata() or {}).get(KEY)
        return None if text is None else msgspec.json.decode(text, type=Header)
    except FileNotFoundError:
        raise CheckpointError(f'no file "{path}"') from None
    except (SafetensorError, msgspec.MsgspecError, OSError) as error:
        raise CheckpointError(f'"{path}" has a header that does not read: {error}') from None


def notes(header: Header) -> dict[str, str]:
    """The header as an entry of a file's metadata."""
    return {KEY: msgspec.json.encode(header).decode()}


def _name(task: Task) -> str:
    settings = ", ".join(f"{key} {value}" for key, value in task.kwargs.items())
    return f"{task.env} ({settings})" if settings else task.env
