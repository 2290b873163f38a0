"""Who is there and how they are: ``swarm status``, and the part of it that others use.

An observer is a peer without a port of its own: it dials the agents' endpoints, listens, and is not
a member of the roster.
"""

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec
import zenoh
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from agent.config.experiment import SwarmFile, load
from agent.storage.runfolder import RunFolder
from agent.storage.runs import LATEST, RUNS
from deploy.process.signals import stop_meanwhile
from swarm.errors import ConfigError
from swarm.mixing.consensus import sketch_errors
from swarm.reports.telemetry import AgentStatus, NeighbourStatus, ask_status
from swarm.wire.keys import Keys
from swarm.wire.security import OBSERVER
from swarm.wire.session import open_session

CODES = {"healthy": 0, "degraded": 1, "nobody": 3}  # exit codes
REFRESH = 0.5  # [s] between two looks of `swarm status --watch`
STALE = 5.0  # [s] from a neighbour that has got on meanwhile, an older message means trouble


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
            "(or start one: swarm up deploy/library/swarms/gridworld-a.toml)"
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


class SwarmStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What ``swarm status --json`` prints.

    Attributes:
        swarm: its name.
        health: ``healthy``, ``degraded`` or ``nobody``.
        problems: why it is not healthy.
        consensus_error: largest distance of an agent from the mean of all, from sketches.
        agents: every agent that answered.
        errors: distance of each agent from the mean.
    """

    swarm: str
    health: str
    problems: tuple[str, ...]
    consensus_error: float | None
    agents: dict[str, AgentStatus]
    errors: dict[str, float]


def judge(config: SwarmFile, answers: dict[str, AgentStatus]) -> SwarmStatus:
    """Sum the answers up."""
    problems = [f"{m} does not answer" for m in config.members if m not in answers]
    for name, answer in answers.items():
        for neighbour, heard in answer.neighbours.items():
            if answer.state == "learning" and _missed(heard, answers.get(neighbour)):
                problems.append(f"{name} last heard {neighbour} {heard.age:.1f} s ago")
        if answer.rejected:
            counts = ", ".join(f"{cause} {n}" for cause, n in sorted(answer.rejected.items()))
            problems.append(f"{name} rejected messages: {counts}")
    errors = sketch_errors({name: answer.sketch for name, answer in answers.items()})
    return SwarmStatus(
        swarm=config.name,
        health="nobody" if not answers else "degraded" if problems else "healthy",
        problems=tuple(problems),
        consensus_error=max(errors.values(), default=None),
        agents=answers,
        errors=errors,
    )


def _missed(heard: NeighbourStatus, itself: AgentStatus | None) -> bool:
    """Whether a neighbour was not heard though it spoke: a long flight is no trouble."""
    if itself is None or heard.age is None or heard.round is None:
        return False
    return heard.age > STALE and heard.round < itself.round


def show_status(target: Target, as_json: bool, timeout: float) -> int:
    """Print the state of a swarm; the exit code says the same."""
    with observe(target.config) as session:
        summary = judge(target.config, collect(session, target.config, timeout))
    if as_json:
        print(msgspec.json.format(msgspec.json.encode(summary), indent=2).decode())
    else:
        Console().print(picture(target.config, summary))
    return CODES[summary.health]


def watch_status(target: Target, timeout: float) -> int:
    """Show the state of a swarm, again and again, until Ctrl-C; the exit code is the last one's."""
    config, health = target.config, "nobody"
    with (
        stop_meanwhile() as stop,
        observe(config) as session,
        Live(console=Console(), auto_refresh=False) as live,
    ):
        while True:
            summary = judge(config, collect(session, config, timeout))
            health = summary.health
            live.update(picture(config, summary), refresh=True)
            if stop.wait(REFRESH):
                return CODES[health]


def picture(config: SwarmFile, summary: SwarmStatus) -> Group:
    """A summary as a table, with what is wrong below."""
    if summary.health == "nobody":
        endpoints = ", ".join(config.endpoint(member) for member in config.members)
        return Group(Text(f'nobody of swarm "{config.name}" answers on {endpoints}'))
    table = Table(title=f"swarm {config.name}: {summary.health}")
    for heading in ("agent", "state", "round", "return", "consensus error", "neighbours", "MB"):
        table.add_column(heading, justify="left" if heading in {"agent", "state"} else "right")
    for name in sorted(summary.agents):
        answer = summary.agents[name]
        nearby = ", ".join(
            f"{n} ({'never' if heard.age is None else f'{heard.age * 1e3:.0f} ms'})"
            for n, heard in answer.neighbours.items()
        )
        table.add_row(
            name,
            answer.state,
            f"{answer.round}/{answer.rounds}",
            "-" if answer.value is None else f"{answer.value:.3f}",
            f"{summary.errors[name]:.3f}" if name in summary.errors else "-",
            nearby,
            f"{answer.memory_mb:.0f}",
        )
    problems = (Text(f"  {problem}", style="yellow") for problem in summary.problems)
    return Group(table, Text(f"  {_weights(summary.agents)}"), *problems)


def _weights(agents: Mapping[str, AgentStatus]) -> str:
    """Whether both ends of every edge used the same weight in every round."""
    one_sided = {name: answer.one_sided for name, answer in agents.items() if answer.one_sided}
    if not one_sided:
        return "W was symmetric and doubly stochastic on what was exchanged, in every round"
    counts = ", ".join(f"{name} {count}" for name, count in sorted(one_sided.items()))
    return f"edges that only one end used in a round, so far: {counts}"
