"""Before anything starts: tasks and certificates are checked, the run folder made, ports held.

Interface: :func:`prepare` for a new run, :func:`resume` for one that goes on.
"""

import logging
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec

from agent.config.experiment import SwarmFile, load
from agent.learning.learners import build_learner
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder, open_run
from agent.storage.runs import check_own_folder, new_run, point_latest_to
from deploy.flying.warmup import warm_up
from deploy.process.news import working
from deploy.process.ports import hold, hold_free
from deploy.process.signals import stop_meanwhile
from swarm.errors import ConfigError
from swarm.wire.security import OBSERVER

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Prepared:
    """A swarm that can be launched.

    Attributes:
        folder: its run folder.
        config: the resolved configuration, with the ports that are held for it.
        begin: first round; None where each agent stopped.
        fresh: whether nothing has been played yet.
        stop: set when the user wants the swarm to end.
    """

    folder: RunFolder
    config: SwarmFile
    begin: int | None
    fresh: bool
    stop: threading.Event


@contextmanager
def prepare(config: SwarmFile, run: Path | None) -> Iterator[Prepared]:
    """A new run folder, and ports that are held until the end of the block.

    Args:
        config: the swarm file.
        run: the folder; None for a new one in ``runs/``.

    Raises:
        ConfigError: the folder exists already, or a task cannot be built.
    """
    get_ready(config)
    check_certificates(config)
    if run is not None:
        check_own_folder("--run", run)
        if RunFolder(run).config.exists():
            raise ConfigError(
                f'run folder "{run}" is in use: expected a new one, or --resume {run}'
            )
    with stop_meanwhile() as stop, held_ports(config) as placed:
        folder = RunFolder(run or new_run(config.name))
        folder.write_config(placed)
        if run is None:
            point_latest_to(folder.path)
        yield Prepared(folder, placed, 0, True, stop)


@contextmanager
def resume(path: Path, settings: Iterable[str]) -> Iterator[Prepared]:
    """A run folder to go on with.

    Raises:
        ConfigError: not a run folder, or a task cannot be built.
    """
    folder, config = open_again(path, settings)
    check_certificates(config)
    begin = where_to_begin(folder, config)
    get_ready(config)
    with stop_meanwhile() as stop, held_ports(config) as placed:
        folder.write_config(placed)
        yield Prepared(folder, placed, begin, False, stop)


def open_again(path: Path, settings: Iterable[str]) -> tuple[RunFolder, SwarmFile]:
    """A run folder and its configuration.

    Raises:
        ConfigError: not a run folder.
    """
    folder = open_run(path.resolve() if path.is_symlink() else path)
    return folder, load(folder.config, settings)


def where_to_begin(folder: RunFolder, config: SwarmFile) -> int | None:
    """The last round that all agents have; None: each goes on from its own.

    So it is where rounds are not common (``pace = "async"``), and where a fault has left none that
    all have: who is behind takes over a neighbour's state.
    """
    if config.pace == "async":
        return None
    begin = folder.common_round(config.members, config.checkpoint_every)
    if begin is None:
        log.warning(
            'run "%s" has no round that all agents have a checkpoint of; each goes on from its own',
            folder.path,
        )
    return begin


def is_finished(folder: RunFolder, config: SwarmFile) -> bool:
    """Whether every agent has played all rounds."""
    kept = [checkpoint.newest(folder.checkpoints(agent)) for agent in config.members]
    return all(at is not None and config.progress(at) >= config.rounds for at in kept)


def get_ready(config: SwarmFile) -> None:
    """Find mistakes in the tasks, and fill the caches that all agents read, before they start.

    Raises:
        ConfigError: a task cannot be built, or two tasks do not fit one policy.
    """
    with working("getting ready"):
        check_tasks(config)
        warm_up(entry.task for entry in config.agents)


def check_tasks(config: SwarmFile) -> None:
    """Build every task once, so that a mistake is told before anything starts.

    Raises:
        ConfigError: a task cannot be built, or two tasks do not fit one policy.
    """
    parts = {}
    for agent in config.members:
        learner = build_learner(config, agent)
        parts[agent] = learner.parts
        learner.close()
    first = config.members[0]
    for agent, shape in parts.items():
        if shape != parts[first]:
            raise ConfigError(
                f'task of "{agent}" needs parameters {dict(shape)}: expected those of "{first}", '
                f"{dict(parts[first])}, for one common policy"
            )


def check_certificates(config: SwarmFile) -> None:
    """See that every agent and the launcher itself have their files of ``[network.security]``.

    Raises:
        ConfigError: one of them will not do.
    """
    for name in (*config.members, OBSERVER):
        config.network.security.check(name)


@contextmanager
def held_ports(config: SwarmFile) -> Iterator[SwarmFile]:
    """Hold the agents' ports for them, the file's own or, where one is taken, others.

    Endpoints of their own (``agents.*.endpoint``) are the user's to keep free.

    Yields:
        The configuration with these ports.

    Raises:
        ConfigError: there are none.
    """
    if all(agent.endpoint for agent in config.agents):
        yield config
        return
    host, first, count = config.network.host, config.network.base_port, len(config.agents)
    with hold(host, range(first, first + count)) or hold_free(host, count) as held:
        network = msgspec.structs.replace(config.network, base_port=held.numbers[0])
        yield msgspec.structs.replace(config, network=network)
