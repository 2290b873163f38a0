"""A chaos file: its ``[[fault]]`` tables as frozen, documented fields.

Interface: :func:`load_faults`.  :mod:`deploy.chaos` has the table of kinds.
"""

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from agent.config.experiment import SwarmFile
from agent.config.strict import convert, read_toml
from deploy.chaos import clocks
from swarm.errors import ConfigError

Kind = Literal["kill", "restart", "freeze", "slow", "partition", "loss", "rate", "clock"]
NETWORK_KINDS = ("partition", "loss", "rate")
ALL = "*"


class Fault(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One table of a chaos file.

    Attributes:
        at: when [s]; after that, not before ``round``.
        round: when the slowest agent has come so far.
        kind: what.
        agents: to whom; ``["*"]`` for everybody.
        apart: rounds between one of the agents and the next, at least; 0: all at once.
        seconds: for how long [s], where it lasts.
        probability: of ``loss``.
        kbit: of ``rate`` [kbit/s].
        factor: of ``slow``.
        by: of ``clock`` [s].
    """

    kind: Kind
    agents: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]
    at: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    round: Annotated[int, msgspec.Meta(ge=0)] = 0
    apart: Annotated[int, msgspec.Meta(ge=0)] = 0
    seconds: Annotated[float, msgspec.Meta(gt=0)] = 5.0
    probability: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.2
    kbit: Annotated[int, msgspec.Meta(ge=1)] = 1000
    factor: Annotated[float, msgspec.Meta(gt=1)] = 5.0
    by: float = 3600.0

    def __str__(self) -> str:
        jump = f" by {self.by:+g} s" if self.kind == "clock" else ""
        return f"{self.kind} {', '.join(self.agents)}{jump}"


class ChaosFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All faults of a run."""

    fault: tuple[Fault, ...]


def load_faults(path: Path, config: SwarmFile) -> tuple[Fault, ...]:
    """Read a chaos file, check it against the swarm it is for, and name everybody it means.

    Raises:
        ConfigError: it is not one, names a stranger, or needs what the swarm or machine has not.
    """
    faults: list[Fault] = []
    for i, fault in enumerate(convert(read_toml(path), ChaosFile, str(path)).fault):
        for agent in _named(fault, config):
            entry = config.agents[config.index(agent)]
            if fault.kind in NETWORK_KINDS and entry.namespace is None:
                raise ConfigError(
                    f'{path}: fault.{i}.kind = "{fault.kind}" needs a network namespace of '
                    f'"{agent}": expected "namespace" in its entry of the swarm file'
                )
        if fault.kind == "clock" and (reason := clocks.why_not()):
            raise ConfigError(f'{path}: fault.{i}.kind = "clock": {reason}')
        faults += _one_by_one(fault, config)
    return tuple(faults)


def _named(fault: Fault, config: SwarmFile) -> tuple[str, ...]:
    return config.members if fault.agents == (ALL,) else fault.agents


def _one_by_one(fault: Fault, config: SwarmFile) -> list[Fault]:
    """The fault with its agents' names; as many faults as agents where they are ``apart``."""
    agents = _named(fault, config)
    if not fault.apart:
        return [msgspec.structs.replace(fault, agents=agents)]
    return [
        msgspec.structs.replace(fault, agents=(agent,), round=fault.round + n * fault.apart)
        for n, agent in enumerate(agents)
    ]
