"""A chaos file: its ``[[fault]]`` tables as frozen, documented fields.

Interface: :func:`load_faults`.  :mod:`deploy.chaos` has the table of kinds.
"""

import re
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from agent.config.experiment import SwarmFile
from agent.config.strict import convert, read_toml
from deploy.chaos import clocks
from swarm.errors import ConfigError

Kind = Literal["kill", "restart", "freeze", "slow", "partition", "loss", "rate", "clock"]
NETWORK_KINDS = ("partition", "loss", "rate")
ALL, FIRST, LAST, HALF = "*", "@first", "@last", "@half"


class _What(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What happens, and to whom.

    Attributes:
        kind: what.
        agents: to whom; see :mod:`deploy.chaos`.
        seconds: for how long [s], where it lasts.
        probability: of ``loss``.
        kbit: of ``rate`` [kbit/s].
        factor: of ``slow``.
        by: of ``clock`` [s].
    """

    kind: Kind
    agents: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]
    seconds: Annotated[float, msgspec.Meta(gt=0)] = 5.0
    probability: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.2
    kbit: Annotated[int, msgspec.Meta(ge=1)] = 1000
    factor: Annotated[float, msgspec.Meta(gt=1)] = 5.0
    by: float = 3600.0


class Entry(_What, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One table of a chaos file.

    Attributes:
        at: when: seconds, or a share of the run such as ``"30%"``.
        round: and not before the slowest agent has come so far.
        until: share of the run; the agents' turns come one by one, evenly, from the beginning to
            then.  Without it all at once.
    """

    at: Annotated[float, msgspec.Meta(ge=0)] | str = 0.0
    round: Annotated[int, msgspec.Meta(ge=0)] = 0
    until: str | None = None


class Fault(_What, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A fault of a certain swarm: whom it means is named, and when it comes.

    Attributes:
        at: when [s]; after that, not before ``round``.
        round: when the slowest agent has come so far.
        apart: rounds between this agent's turn and the next one's, at least.
    """

    at: float = 0.0
    round: int = 0
    apart: int = 0

    def __str__(self) -> str:
        jump = f" by {self.by:+g} s" if self.kind == "clock" else ""
        return f"{self.kind} {', '.join(self.agents)}{jump}"


class ChaosFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All faults of a run."""

    fault: tuple[Entry, ...]


def load_faults(path: Path, config: SwarmFile) -> tuple[Fault, ...]:
    """Read a chaos file for a swarm: who is meant and in which round, all of it checked.

    Raises:
        ConfigError: it is not one, names a stranger, comes when the run is over or never ends, or
            needs what the swarm or the machine has not.
    """
    faults: list[Fault] = []
    for i, entry in enumerate(convert(read_toml(path), ChaosFile, str(path)).fault):
        try:
            agents = _named(entry, config)
            _check(entry, agents, config)
            faults += _in_turn(entry, agents, config.rounds)
        except ConfigError as error:
            raise ConfigError(f"{path}: fault.{i}: {error}") from None
    return tuple(faults)


def _named(entry: Entry, config: SwarmFile) -> tuple[str, ...]:
    """The agents that an entry means, each once."""
    members, found = config.members, dict[str, None]()
    places = {
        ALL: members,
        FIRST: members[:1],
        LAST: members[-1:],
        HALF: members[: max(1, len(members) // 2)],
    }
    for name in entry.agents:
        if name.startswith("@") and name not in places:
            raise ConfigError(f'agents: "{name}": expected an id or one of {", ".join(places)}')
        for agent in places.get(name, (name,)):
            config.index(agent)
            found[agent] = None
    return tuple(found)


def _check(entry: Entry, agents: tuple[str, ...], config: SwarmFile) -> None:
    """What this kind of fault needs of the swarm and of the machine."""
    for agent in agents if entry.kind in NETWORK_KINDS else ():
        if config.agents[config.index(agent)].namespace is None:
            raise ConfigError(
                f'kind = "{entry.kind}" needs a network namespace of "{agent}": '
                'expected "namespace" in its entry of the swarm file'
            )
    if entry.kind == "partition" and set(agents) == set(config.members):
        raise ConfigError('kind = "partition" of all agents: expected one on the other side')
    if entry.kind == "clock" and (reason := clocks.why_not()):
        raise ConfigError(f'kind = "clock": {reason}')


def _in_turn(entry: Entry, agents: tuple[str, ...], rounds: int) -> list[Fault]:
    """Its faults: one for all agents, or, with ``until``, one for each."""
    seconds, begin = (entry.at, 0) if isinstance(entry.at, float | int) else (0.0, None)
    if begin is None:
        begin = _round_of("at", str(entry.at), rounds)
    begin = max(begin, entry.round)
    if begin >= rounds:
        key, value = ("round", entry.round) if begin == entry.round else ("at", f'"{entry.at}"')
        raise ConfigError(
            f"{key} = {value} is when the run is over: expected before its {rounds} rounds"
        )
    fields = {name: getattr(entry, name) for name in _What.__struct_fields__}
    if entry.until is None:
        return [Fault(**fields | {"agents": agents, "at": seconds, "round": begin})]
    end = _round_of("until", entry.until, rounds)
    if end <= begin or end >= rounds:
        raise ConfigError(
            f'until = "{entry.until}" is round {end}: expected after round {begin}, where it '
            f"begins, and before the last of {rounds}"
        )
    apart = (end - begin) // max(1, len(agents) - 1)
    return [
        Fault(
            **fields
            | {"agents": (agent,), "at": seconds, "round": begin + n * apart, "apart": apart}
        )
        for n, agent in enumerate(agents)
    ]


def _round_of(key: str, share: str, rounds: int) -> int:
    """``"30%"`` of so many rounds."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?) ?%", share)
    if match is None or float(match[1]) >= 100:
        wanted = 'a share of the run, "0%" to less than "100%"'
        raise ConfigError(
            f'{key} = "{share}": expected {wanted}{", or seconds" if key == "at" else ""}'
        )
    return int(float(match[1]) / 100 * rounds)
