"""Who is there and how they are: ``swarm status``, and the part of it that others use.

A run folder whose run is over shows its result, and asks nobody.

An observer is a peer without a port of its own: it dials the agents' endpoints, listens, and is not
a member of the roster.
"""

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec
import zenoh
from rich.console import Console
from rich.live import Live

from agent.config.experiment import SwarmFile, load
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder
from agent.storage.runs import LATEST, RUNS
from deploy.observe import crowd
from deploy.observe.health import Health, SwarmStatus, ended, judge
from deploy.observe.picture import picture
from deploy.policies.result import print_result, read_result
from deploy.process.signals import StoppedError, stopping_at_signals
from swarm.errors import ConfigError
from swarm.reports.telemetry import AgentStatus, ask_status
from swarm.wire.keys import Keys
from swarm.wire.security import OBSERVER
from swarm.wire.session import open_session

CODES: dict[Health, int] = {"healthy": 0, "degraded": 1, "nobody": 3}  # exit codes
REFRESH = 0.5  # [s] between two looks of `swarm status --watch`


@dataclass(frozen=True, slots=True)
class Target:
    """A swarm to look at, and the run folder it was found in, if it was."""

    config: SwarmFile
    folder: RunFolder | None


def find_config(target: Path | None, settings: Iterable[str] = ()) -> Target:
    """The swarm that a swarm file or run folder describes; by default that of the newest run.

    Raises:
        ConfigError: there is no such file or folder.
    """
    path = target or LATEST
    if path.is_dir():
        folder = RunFolder(path.resolve())
        return Target(load(folder.config, settings), folder)
    if target is None:
        raise ConfigError(
            f'no run in "{RUNS}/": expected a swarm file or run folder as argument '
            "(or start one: swarm up gridworld-a)"
        )
    return Target(load(path, settings), None)


@contextmanager
def observe(config: SwarmFile) -> Iterator[zenoh.Session]:
    """A session that sees the swarm and takes no part in it."""
    endpoints = [config.endpoint(member) for member in config.members]
    with open_session(config.network, config.party(OBSERVER), (), endpoints) as session:
        yield session


def collect(session: zenoh.Session, config: SwarmFile, timeout: float) -> dict[str, AgentStatus]:
    """Ask until every member has answered or ``timeout`` [s] is over."""
    keys, end = Keys(config.name), time.monotonic() + timeout
    answers: dict[str, AgentStatus] = {}
    while len(answers) < len(config.members) and (left := end - time.monotonic()) > 0:
        answers |= ask_status(session, keys, min(left, 0.5))
        time.sleep(min(0.05, max(0.0, end - time.monotonic())))  # links may still be opening
    return answers


def look(session: zenoh.Session, config: SwarmFile, timeout: float) -> SwarmStatus:
    """How a swarm is now."""
    return judge(config, collect(session, config, timeout))


def show_status(target: Target, as_json: bool, timeout: float) -> int:
    """Print the state of a swarm, or how its run ended; the exit code says the same."""
    config, console = target.config, Console(highlight=False)
    status = _over(target)
    if status is None:
        with observe(config) as session:
            status = look(session, config, timeout)
    if as_json:
        print(msgspec.json.format(msgspec.json.encode(status), indent=2).decode())
    elif status.result is not None and target.folder is not None:
        print_result(status.result, console, target.folder)
    else:
        console.print(picture(config, status, console.height))
        if status.health == "nobody" and target.folder is not None:
            console.print(left_behind(target.folder, config), soft_wrap=True)
    return code_of(status)


def watch_status(target: Target, timeout: float) -> int:
    """Show the state of a swarm, again and again, until Ctrl-C; the exit code is the last one's."""
    config, console = target.config, Console(highlight=False)
    code = CODES["nobody"]
    with observe(config) as session, Live(console=console, auto_refresh=False) as live:
        try:
            with stopping_at_signals():
                while True:
                    status = _over(target) or look(session, config, timeout)
                    code = code_of(status)
                    if status.result is not None and target.folder is not None:
                        live.stop()
                        print_result(status.result, console, target.folder)
                        return code
                    live.update(picture(config, status, console.height), refresh=True)
                    time.sleep(REFRESH)
        except StoppedError:
            return code


def code_of(status: SwarmStatus) -> int:
    """The exit code of ``swarm status``."""
    if status.result is not None:
        return 0 if status.result.state == "finished" else 1
    return CODES[status.health]


def _over(target: Target) -> SwarmStatus | None:
    """How the run of the folder ended; None where there is none, or it goes on."""
    result = None if target.folder is None else read_result(target.folder)
    if result is None or result.state == "running":
        return None
    return ended(target.config, result)


def left_behind(folder: RunFolder, config: SwarmFile) -> str:
    """What is known of a run that nobody is in and that told no end."""
    reached = [max(checkpoint.rounds_in(folder.checkpoints(a)), default=0) for a in config.members]
    if min(reached) >= config.rounds:
        return "all rounds are played; the result is not written yet"
    return (
        f"the run told no end: its processes were killed, or run elsewhere; checkpoints of round "
        f"{crowd.rounds(reached, config.rounds)}; go on with: swarm up --resume {folder.path}"
    )
