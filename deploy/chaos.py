"""Faults on purpose: one file of ``[[fault]]`` tables drives the launcher, the tests and compose.

::

    [[fault]]
    at = 2.0            # [s] after every agent has reported; or: round = 500
    kind = "freeze"
    agents = ["drone1"]
    seconds = 5.0

============  ===================================================================================
kind          what happens to ``agents``
============  ===================================================================================
``kill``      SIGKILL; the launcher starts them again from their checkpoints
``restart``   SIGTERM; likewise
``freeze``    SIGSTOP, and SIGCONT after ``seconds``
``slow``      stopped for all but one ``factor``-th of the time, for ``seconds``
``partition`` cut off from all other agents for ``seconds``
``loss``      each packet that reaches them is dropped with ``probability``, for ``seconds``
``rate``      they send at most ``kbit`` kilobits a second, for ``seconds``
============  ===================================================================================

The last three need agents in network namespaces of their own (``namespace`` in the swarm file) and
root.
"""

import os
import re
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from agent.config import SwarmFile
from agent.strict import convert, read_toml
from swarm.errors import ConfigError, SwarmError

Kind = Literal["kill", "restart", "freeze", "slow", "partition", "loss", "rate"]
NETWORK_KINDS = ("partition", "loss", "rate")
DUTY_CYCLE = 0.2  # [s] period of `slow`
_ADDRESS = re.compile(r"\w+/(?P<host>[^:/\[\]]+|\[[^\]]+\]):\d+")


class Fault(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One row of a chaos file; see the table above.

    Attributes:
        at: when [s]; after that, not before ``round``.
        round: when the slowest agent has come so far.
        kind: what.
        agents: to whom.
        seconds: for how long [s], where it lasts.
        probability: of ``loss``.
        kbit: of ``rate`` [kbit/s].
        factor: of ``slow``.
    """

    kind: Kind
    agents: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]
    at: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    round: Annotated[int, msgspec.Meta(ge=0)] = 0
    seconds: Annotated[float, msgspec.Meta(gt=0)] = 5.0
    probability: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.2
    kbit: Annotated[int, msgspec.Meta(ge=1)] = 1000
    factor: Annotated[float, msgspec.Meta(gt=1)] = 5.0

    def __str__(self) -> str:
        return f"{self.kind} {', '.join(self.agents)}"


class ChaosFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All faults of a run."""

    fault: tuple[Fault, ...]


def load_faults(path: Path, config: SwarmFile) -> tuple[Fault, ...]:
    """Read a chaos file and check it against the swarm it is for.

    Raises:
        ConfigError: it is not one, names a stranger, or needs namespaces that the swarm has not.
    """
    faults = convert(read_toml(path), ChaosFile, str(path)).fault
    for i, fault in enumerate(faults):
        for agent in fault.agents:
            entry = config.agents[config.index(agent)]
            if fault.kind in NETWORK_KINDS and entry.namespace is None:
                raise ConfigError(
                    f'{path}: fault.{i}.kind = "{fault.kind}" needs a network namespace of '
                    f'"{agent}": expected "namespace" in its entry of the swarm file'
                )
    return faults


@dataclass(frozen=True, slots=True)
class Action:
    """Something to do so long after its fault began [s]: signals, or commands in namespaces."""

    at: float
    label: str
    signals: tuple[tuple[str, signal.Signals], ...] = ()
    commands: tuple[tuple[str, ...], ...] = ()


def plan(fault: Fault, config: SwarmFile) -> list[Action]:
    """What a fault consists of, in order of time.  Decides all; does nothing."""
    name, end = str(fault), f"end of {fault}"
    match fault.kind:
        case "kill":
            return [_signal(0.0, name, fault.agents, signal.SIGKILL)]
        case "restart":
            return [_signal(0.0, name, fault.agents, signal.SIGTERM)]
        case "freeze":
            return [
                _signal(0.0, name, fault.agents, signal.SIGSTOP),
                _signal(fault.seconds, end, fault.agents, signal.SIGCONT),
            ]
        case "slow":
            return _duty_cycle(fault)
        case "partition" | "loss" | "rate":
            start, stop = _network_commands(fault, config)
            return [
                Action(0.0, name, commands=tuple(start)),
                Action(fault.seconds, end, commands=tuple(stop)),
            ]


def _signal(at: float, label: str, agents: tuple[str, ...], what: signal.Signals) -> Action:
    return Action(at, label, signals=tuple((agent, what) for agent in agents))


def _duty_cycle(fault: Fault) -> list[Action]:
    """Stop and go, with one line of news at the start and one at the end."""
    cycles = max(1, round(fault.seconds / DUTY_CYCLE))
    actions = []
    for i in range(cycles):
        at = i * DUTY_CYCLE
        label = f"{fault}" if i == 0 else ""
        actions.append(_signal(at, label, fault.agents, signal.SIGSTOP))
        label = f"end of {fault}" if i == cycles - 1 else ""
        go = at + DUTY_CYCLE * (1 - 1 / fault.factor)
        actions.append(_signal(go, label, fault.agents, signal.SIGCONT))
    return actions


def _network_commands(
    fault: Fault, config: SwarmFile
) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    """Commands that begin and end a fault of the network."""
    start: list[tuple[str, ...]] = []
    stop: list[tuple[str, ...]] = []
    others = [agent for agent in config.members if agent not in fault.agents]
    for agent in fault.agents:
        entry = config.agents[config.index(agent)]
        inside = ("ip", "netns", "exec", str(entry.namespace))
        if fault.kind == "partition":
            for other in others:
                address = host_of(config.endpoint(other))
                for rule in (("INPUT", "-s", address), ("OUTPUT", "-d", address)):
                    start.append((*inside, "iptables", "-A", *rule, "-j", "DROP"))
                    stop.append((*inside, "iptables", "-D", *rule, "-j", "DROP"))
        elif fault.kind == "loss":
            chance = ("-m", "statistic", "--mode", "random", "--probability")
            rule3 = ("INPUT", *chance, f"{fault.probability}", "-j", "DROP")
            start.append((*inside, "iptables", "-A", *rule3))
            stop.append((*inside, "iptables", "-D", *rule3))
        else:
            device = ("dev", str(entry.device), "root")
            shape = ("tbf", "rate", f"{fault.kbit}kbit", "burst", "32kbit", "latency", "400ms")
            start.append((*inside, "tc", "qdisc", "replace", *device, *shape))
            stop.append((*inside, "tc", "qdisc", "del", *device))
    return start, stop


def host_of(endpoint: str) -> str:
    """The address in ``tcp/10.0.0.1:7447``."""
    match = _ADDRESS.fullmatch(endpoint)
    if match is None:
        raise ConfigError(f'endpoint "{endpoint}": expected protocol/host:port')
    return match["host"].strip("[]")


@dataclass(slots=True)
class Chaos:
    """Carries faults out as time passes.

    Attributes:
        config: the swarm's.
        faults: those that have not begun.
        started: monotonic time of the file's zero [s]; None until every agent has reported.
        due: monotonic time and action of what has begun, in order.
    """

    config: SwarmFile
    faults: list[Fault]
    started: float | None = None
    due: list[tuple[float, Action]] = field(default_factory=list)

    def advance(self, now: float, round_: int, pids: Mapping[str, int]) -> list[str]:
        """Do what is due; labels of what was done, for the user.

        Args:
            now: monotonic time [s].
            round_: of the slowest agent.
            pids: process of each running agent.

        Raises:
            SwarmError: a command failed.
        """
        if self.started is None:
            return []
        for fault in list(self.faults):
            if now - self.started >= fault.at and round_ >= fault.round:
                self.faults.remove(fault)
                self.due += [(now + action.at, action) for action in plan(fault, self.config)]
        self.due.sort(key=lambda entry: entry[0])
        labels = []
        while self.due and now >= self.due[0][0]:
            _, action = self.due.pop(0)
            for agent, what in action.signals:
                if agent in pids:
                    os.kill(pids[agent], what)
            for command in action.commands:
                _run(command)
            if action.label:
                labels.append(action.label)
        return labels

    def undo(self, pids: Mapping[str, int]) -> None:
        """End what lasts: let stopped agents go on, lift the network's faults."""
        for _, action in self.due:
            if not action.label.startswith("end of "):
                continue
            for agent, what in action.signals:
                if agent in pids and what == signal.SIGCONT:
                    os.kill(pids[agent], what)
            for command in action.commands:
                subprocess.run(command, capture_output=True, check=False, timeout=10)


def _run(command: tuple[str, ...]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10)
    if done.returncode:
        raise SwarmError(f"fault: {' '.join(command)}: {done.stderr.strip()}")
