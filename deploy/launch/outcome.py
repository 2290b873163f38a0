"""The end of ``swarm up``: what the run came to is kept, shown and recorded."""

import msgspec
import numpy as np
from rich.console import Console

from agent.config.experiment import SwarmFile
from agent.learning.policies import Tabular
from agent.storage.runfolder import RunFolder
from deploy.policies.result import print_result, result_of
from deploy.policies.summary import print_summary


def conclude(folder: RunFolder, config: SwarmFile, record: bool) -> None:
    """Evaluate a finished run, keep the numbers, print the table, write the recording."""
    if not isinstance(config.policy, Tabular):
        print_summary(folder, config)
        return
    result = result_of(config, np.stack([folder.newest(agent).theta for agent in config.members]))
    folder.result.write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=2))
    console = Console(highlight=False)
    print_result(result, console)
    if record and (recording := _record(folder, config)):
        console.print(f"recording: {recording}")
    console.print(f"run folder: {folder.path}", soft_wrap=True)


def _record(folder: RunFolder, config: SwarmFile) -> str | None:
    """Turn the run folder into a Rerun recording, where rerun-sdk is installed."""
    try:
        from deploy.viewer import record_run  # noqa: PLC0415
    except ImportError:
        return "none (rerun-sdk is not installed)"
    record_run(folder, config, folder.recording)
    return str(folder.recording)
