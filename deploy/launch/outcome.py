"""The end of ``swarm up``: how it ended is kept, whatever it is like; a finished run is scored,
shown and recorded.

Interface: :func:`outcome_kept` around the run, :func:`conclude` and :func:`interrupt` at its end.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from msgspec.structs import replace
from rich.console import Console

from agent.config.experiment import SwarmFile
from agent.errors import CheckpointError
from agent.storage.files import drafted
from agent.storage.runfolder import RunFolder
from deploy.policies.result import Result, print_result, read_result, score, write_result
from swarm.errors import ConfigError, SwarmError


@contextmanager
def outcome_kept(folder: RunFolder, config: SwarmFile) -> Iterator[None]:
    """``result.json`` says that the run goes on, and that it failed where the block raises."""
    begun = Result(
        swarm=config.name, state="running", rounds=config.rounds, started=time.time()
    )  # fmt: skip
    write_result(folder, begun)
    try:
        yield
    except BaseException as error:
        cause = str(error) if isinstance(error, SwarmError) else type(error).__name__
        ended = {"reached": reached(folder, config), "ended": time.time()}
        write_result(folder, replace(begun, state="failed", cause=cause, **ended))
        raise


def conclude(
    folder: RunFolder, config: SwarmFile, record: bool, given_up: Sequence[str] = ()
) -> Result:
    """Score a run that is over, keep the numbers, write the recording, print the table.

    Args:
        folder, config: of the run.
        record: write a Rerun recording, where rerun-sdk is installed.
        given_up: agents that were not brought back any more.

    Raises:
        CheckpointError: an agent that finished left no policy that reads.
    """
    console = Console(highlight=False)
    result = _ended(folder, config)
    if given_up:
        cause = f"given up: {', '.join(given_up)}"
        result = replace(result, state="incomplete", cause=cause)
    try:
        result = replace(result, scores=score(folder, config))
    except CheckpointError:
        if not given_up:
            raise
    write_result(folder, result)
    if record and (why := _record(folder, config)):
        console.print(f"recording: none ({why})")
    print_result(result, console, folder)
    return result


def interrupt(folder: RunFolder, config: SwarmFile) -> None:
    """Keep that the user ended the run.  It is neither scored nor recorded: the user waits."""
    write_result(folder, replace(_ended(folder, config), state="interrupted"))


def reached(folder: RunFolder, config: SwarmFile) -> dict[str, int]:
    """How far each agent came, by its newest checkpoint."""
    rounds = dict.fromkeys(config.members, 0)
    for agent in config.members:
        try:
            rounds[agent] = int(config.progress(folder.newest(agent)))
        except CheckpointError:
            continue
    return rounds


def _ended(folder: RunFolder, config: SwarmFile) -> Result:
    """A finished run, as yet without scores."""
    begun, now = read_result(folder), time.time()
    return Result(
        swarm=config.name, state="finished", rounds=config.rounds,
        reached=reached(folder, config), started=begun.started if begun else now, ended=now,
    )  # fmt: skip


def _record(folder: RunFolder, config: SwarmFile) -> str:
    """Turn the run folder into a Rerun recording; why there is none, empty where there is."""
    try:
        from deploy.viewer import record_run  # noqa: PLC0415
    except ImportError:
        return "rerun-sdk is not installed"
    try:
        with drafted(folder.recording, durable=False) as draft:
            record_run(folder, config, draft)
    except (OSError, ConfigError) as error:  # a full disk costs the recording, not the result
        return str(error)
    return ""
