"""``result.json``: how a run ended and what it came to; one type for every kind of run.

Interface: :class:`Result`, :func:`score` (what a finished run is worth), :func:`read_result` and
:func:`write_result`, :func:`print_result`.

A launcher writes the file at its start (``running``) and again at its end, whatever that is like.
"""

import time
from typing import Literal

import msgspec
import numpy as np
from rich.console import Console
from rich.markup import escape

from agent.config.experiment import SwarmFile
from agent.learning.policies import Tabular
from agent.storage.files import write_file
from agent.storage.runfolder import RunFolder
from deploy.policies.summary import NetworkScores, network_scores, print_network
from deploy.policies.tables import TabularScores, print_tables, tabular_scores
from swarm.errors import ConfigError

State = Literal["running", "finished", "incomplete", "interrupted", "failed"]


class Result(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A run, as far as it came.

    Attributes:
        swarm: its name.
        state: ``running``; ``finished``: every agent played its rounds; ``incomplete``: the
            others did, but some were given up; ``interrupted`` by the user; ``failed``.
        cause: why it failed, or who was given up; empty otherwise.
        rounds: that were to be played.
        reached: how far each agent came, of these.
        started, ended: of the launcher [Unix s]; ``ended`` is None while it runs.
        scores: what was learned, by the kind of policy (``"kind": "tabular"`` or ``"network"``);
            None unless the run is finished or incomplete.
    """

    swarm: str
    state: State
    cause: str = ""
    rounds: int
    reached: dict[str, int] = {}
    started: float
    ended: float | None = None
    scores: TabularScores | NetworkScores | None = None


def score(folder: RunFolder, config: SwarmFile) -> TabularScores | NetworkScores:
    """What the policies of a run are worth.

    Raises:
        CheckpointError: an agent left none that reads.
    """
    if not isinstance(config.policy, Tabular):
        return network_scores(folder, config)
    thetas = np.stack([folder.newest(agent).theta for agent in config.members])
    return tabular_scores(config, thetas)


def write_result(folder: RunFolder, result: Result) -> None:
    """Keep a result in its run folder; whoever reads meanwhile finds the old one or the new one."""
    write_file(folder.result, msgspec.json.format(msgspec.json.encode(result), indent=2))


def read_result(folder: RunFolder) -> Result | None:
    """The result in a run folder; None where there is none.

    Raises:
        ConfigError: it does not read.
    """
    try:
        return msgspec.json.decode(folder.result.read_bytes(), type=Result)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.MsgspecError) as error:
        raise ConfigError(f'"{folder.result}" does not read: {error}') from None


def print_result(result: Result, console: Console, folder: RunFolder) -> None:
    """How the run ended, its table, and where to go on."""
    begun = time.strftime("%Y-%m-%d %H:%M", time.localtime(result.started))
    took = "" if result.ended is None else f" after {_duration(result.ended - result.started)}"
    cause = f": {result.cause}" if result.cause else ""
    console.print(
        escape(f"swarm {result.swarm}, begun {begun}: {result.state}{took}{cause}"), soft_wrap=True
    )
    match result.scores:
        case TabularScores():
            print_tables(result.scores, result.rounds, console)
        case NetworkScores():
            print_network(result.scores, result.rounds, console)
            console.print(f"fly what was learned: swarm eval {folder.path}", soft_wrap=True)
        case None:
            reached = result.reached.values()
            if reached:
                console.print(f"rounds {min(reached)} to {max(reached)} of {result.rounds}")
            console.print(f"go on with: swarm up --resume {folder.path}", soft_wrap=True)
    if folder.recording.exists():
        console.print(f"recording: {folder.recording}", soft_wrap=True)
    console.print(f"run folder: {folder.path}", soft_wrap=True)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else (
        f"{seconds:.1f} s")  # fmt: skip
