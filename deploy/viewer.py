"""What a swarm looks like in Rerun: live, or from a run folder."""

from pathlib import Path

from agent.config import SwarmFile
from agent.runfolder import RunFolder
from deploy.status import Target


def record_run(folder: RunFolder, config: SwarmFile, path: Path) -> None:
    """Write a recording of a run folder."""
    raise ImportError


def view(target: Target, save: Path | None, live: bool | None) -> None:
    """Show a swarm."""
    raise ImportError
