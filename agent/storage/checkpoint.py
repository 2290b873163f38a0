"""An agent's whole state at the beginning of a round, on disk as safetensors.

A checkpoint is written beside its final name and moved there in one step, so a reader finds a
whole one or none.  After a power cut it may be torn nevertheless: it holds a checksum, and
:func:`newest` passes over what does not read.  Which are kept, :mod:`agent.storage.shelf` decides.
"""

import logging
import os
from dataclasses import dataclass, field
from pathlib import Path
from zlib import crc32

import msgspec
import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from agent.errors import CheckpointError
from agent.storage.files import write_file
from swarm.protocol.accounts import Account

log = logging.getLogger(__name__)
Vector = NDArray[np.floating]
# Agents of a ring stop at slightly different rounds, and a swarm resumes at the newest round that
# all of them have.
KEPT = 16  # of a few kilobytes each
KEPT_LARGE = 4
LARGE = 2**20  # bytes


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """What an agent needs to begin ``round`` as if it had never stopped.

    Attributes:
        round: the round that begins with these parameters.
        fingerprint: of the parameters' layout.
        theta: (d,) parameters.
        mixing: vectors of the mixing rule.
        optimizer: vectors of the optimiser.
        episodes, steps: flown so far.
        learned: so far [rounds], in a swarm without common rounds; see
            :mod:`swarm.mixing.staleness`.
        run: of the experiment, to which it belongs.
        accounts: what was used of whom (:mod:`swarm.protocol.accounts`), by neighbour.
    """

    round: int
    fingerprint: str
    theta: Vector
    mixing: dict[str, Vector] = field(default_factory=dict)
    optimizer: dict[str, Vector] = field(default_factory=dict)
    episodes: int = 0
    steps: int = 0
    learned: float = 0.0
    run: str | None = None
    accounts: dict[str, Account] = field(default_factory=dict)


def path_of(folder: Path, round_: int) -> Path:
    """File of the checkpoint that begins a round."""
    return folder / f"{round_:08d}.safetensors"


def rounds_in(folder: Path) -> list[int]:
    """Rounds that a folder has checkpoints of, oldest first."""
    return sorted(int(f.stem) for f in folder.glob("*.safetensors") if f.stem.isdigit())


def write(folder: Path, checkpoint: Checkpoint, *, durable: bool = True) -> Path:
    """Write it; ``durable`` as in :mod:`agent.storage.files`.

    Raises:
        OSError: the disk refuses.
    """
    tensors = {"theta": checkpoint.theta}
    tensors |= {f"mixing.{name}": v for name, v in checkpoint.mixing.items()}
    tensors |= {f"optimizer.{name}": v for name, v in checkpoint.optimizer.items()}
    notes = {
        "round": str(checkpoint.round),
        "fingerprint": checkpoint.fingerprint,
        "episodes": str(checkpoint.episodes),
        "steps": str(checkpoint.steps),
        "learned": repr(checkpoint.learned),
        "run": msgspec.json.encode(checkpoint.run).decode(),
        "accounts": msgspec.json.encode(checkpoint.accounts).decode(),
        "checksum": str(_checksum(tensors)),
    }
    final = path_of(folder, checkpoint.round)
    write_file(final, save(tensors, notes), durable=durable)
    return final


def drop_after(folder: Path, round_: int) -> None:
    """Remove checkpoints of later rounds: those rounds are about to be played anew."""
    for later in rounds_in(folder):
        if later > round_:
            path_of(folder, later).unlink(missing_ok=True)


def newest(folder: Path) -> Checkpoint | None:
    """The newest checkpoint that reads, with a line for each that does not; None without any."""
    for round_ in reversed(rounds_in(folder)):
        try:
            return read(path_of(folder, round_))
        except CheckpointError as error:
            log.warning("%s; passing over it", error)
    return None


def read(path: Path, fingerprint: str | None = None) -> Checkpoint:
    """Read a checkpoint.

    Args:
        path: the file.
        fingerprint: expected layout; None accepts any.

    Raises:
        CheckpointError: missing, torn, or of another layout.
    """
    try:
        with safe_open(os.fspath(path), framework="numpy") as file:
            notes = file.metadata() or {}
            tensors: dict[str, Vector] = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if int(notes["checksum"]) != _checksum(tensors):
            raise ValueError("its checksum differs")
        checkpoint = Checkpoint(
            round=int(notes["round"]),
            fingerprint=notes["fingerprint"],
            theta=tensors["theta"],
            mixing=_under("mixing.", tensors),
            optimizer=_under("optimizer.", tensors),
            episodes=int(notes["episodes"]),
            steps=int(notes["steps"]),
            learned=float(notes.get("learned", 0.0)),
            run=msgspec.json.decode(notes.get("run", "null"), type=str | None),
            accounts=msgspec.json.decode(notes.get("accounts", "{}"), type=dict[str, Account]),
        )
    except FileNotFoundError:
        raise CheckpointError(f'no checkpoint "{path}"') from None
    except (SafetensorError, KeyError, ValueError, OSError) as error:
        raise CheckpointError(f'checkpoint "{path}" does not read: {error}') from None
    if fingerprint is not None and checkpoint.fingerprint != fingerprint:
        raise CheckpointError(
            f'checkpoint "{path}" has layout {checkpoint.fingerprint}: expected {fingerprint}; '
            "was the swarm file's policy, mixing or name changed?"
        )
    return checkpoint


def _checksum(tensors: dict[str, Vector]) -> int:
    """CRC-32 of all tensors, in the order of their names."""
    total = 0
    for name in sorted(tensors):
        total = crc32(np.ascontiguousarray(tensors[name]).tobytes(), total)
    return total


def _under(prefix: str, tensors: dict[str, Vector]) -> dict[str, Vector]:
    return {name.removeprefix(prefix): v for name, v in tensors.items() if name.startswith(prefix)}
