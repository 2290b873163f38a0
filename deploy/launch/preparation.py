"""Before anything starts: tasks and certificates are checked, the run folder made, ports held.

Interface: :func:`prepare` for a new run, :func:`resume` for one that goes on.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec

from agent.config.experiment import SwarmFile, load
from agent.learning.learners import build_learner
from agent.storage.runfolder import RunFolder, open_run
from agent.storage.runs import check_own_folder, new_run, point_latest_to
from deploy.flying.warmup import warm_up
from deploy.process.news import working
from deploy.process.ports import hold, hold_free
from swarm.errors import ConfigError
from swarm.wire.security import OBSERVER


@dataclass(frozen=True, slots=True)
class Prepared:
    """A swarm that can be launched.

    Attributes:
        folder: its run folder.
        config: the resolved configuration, with the ports that are held for it.
        begin: first round; 0 starts afresh, None where each agent stopped.
    """

    folder: RunFolder
    config: SwarmFile
    begin: int | None


@contextmanager
def prepare(config: SwarmFile, run: Path | None) -> Iterator[Prepared]:
    """A new run folder, and ports that are held until the end of the block.

    Args:
        config: the swarm file.
        run: the folder; None for a new one in ``runs/``.

    Raises:
        ConfigError: the folder exists already, or a task cannot be built.
    """
    with working("getting ready"):
        check_tasks(config)
        warm_up(entry.task for entry in config.agents)
    check_certificates(config)
    if run is not None:
        check_own_folder("--run", run)
        if RunFolder(run).config.exists():
            raise ConfigError(
                f'run folder "{run}" is in use: expected a new one, or --resume {run}'
            )
    with held_ports(config) as placed:
        folder = RunFolder(run or new_run(config.name))
        folder.write_config(placed)
        if run is None:
            point_latest_to(folder.path)
        yield Prepared(folder, placed, 0)


@contextmanager
def resume(path: Path, settings: Iterable[str]) -> Iterator[Prepared]:
    """A run folder to go on with, from the last round that all agents have.

    Where rounds are not common (``pace = "async"``) there is none to begin with: every agent goes
    on from its own.

    Raises:
        ConfigError: not a run folder.
        CheckpointError: no common round.
    """
    folder = open_run(path)
    config = load(folder.config, settings)
    check_certificates(config)
    begin = None if config.pace == "async" else folder.common_round(config.members)
    with held_ports(config) as placed:
        folder.write_config(placed)
        yield Prepared(folder, placed, begin)


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
