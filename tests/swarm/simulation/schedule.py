"""What goes wrong in one play of the simulation, drawn from a seed and printed when it fails."""

import random
from dataclasses import dataclass, replace
from typing import Literal

from swarm.mixing.rules import RULES, RuleName
from swarm.mixing.weights import Kind

Damage = Literal["crash", "freeze", "cut", "lossy", "twin", "leave", "late", "lie"]
Disk = Literal["kept", "old", "torn", "lost"]
LIES = ("round", "norm", "neighbours", "number", "rounds", "run", "incarnation", "phase", "learned")
CALM = 3.0  # [s] before the first fault
STORM = 5.0  # [s] in which faults begin
KINDS: tuple[Kind, ...] = ("ring", "path", "complete", "star", "grid")


@dataclass(frozen=True)
class Fault:
    """Attributes:
    kind: what.
    agent: to whom (number).
    at: when [s].
    seconds: for how long.
    other: the other end of a cut, or -1: the agent is cut off from all.
    one_way: a cut that lets the other direction through.
    disk: with which a crashed agent comes back.
    lie: the field that a traitor lies about.
    """

    kind: Damage
    agent: int
    at: float
    seconds: float = 0.0
    other: int = -1
    one_way: bool = False
    disk: Disk = "kept"
    lie: str = ""


@dataclass(frozen=True)
class Schedule:
    """One play.

    Attributes:
        seed: of everything that is left to chance.
        agents: how many.
        topology, rule: of the swarm.
        latency: of all links, one way [s].
        jitter: up to so much more, so that messages overtake each other [s].
        duplicates: chance of a message to arrive twice.
        clocks: by how much the wall clocks are wrong, at most [s].
        faults: what goes wrong.
    """

    seed: int
    agents: int
    topology: Kind
    rule: RuleName
    latency: float
    jitter: float
    duplicates: float
    clocks: float
    faults: tuple[Fault, ...]

    def without(self, index: int) -> "Schedule":
        """The same with a fault less."""
        return replace(self, faults=self.faults[:index] + self.faults[index + 1 :])

    @property
    def traitors(self) -> frozenset[int]:
        """Agents that lie."""
        return frozenset(fault.agent for fault in self.faults if fault.kind == "lie")

    @property
    def calm_from(self) -> float:
        """When the last fault is over [s]."""
        return max((fault.at + fault.seconds for fault in self.faults), default=CALM)

    def __str__(self) -> str:
        head = (
            f"seed {self.seed}: {self.agents} agents, {self.topology}, {self.rule}, latency "
            f"{self.latency * 1e3:.0f} + {self.jitter * 1e3:.0f} ms, clocks {self.clocks:.0f} s"
        )
        return "\n".join([head, *(f"    {fault}" for fault in self.faults)])


def draw(seed: int, kinds: tuple[Damage, ...] = (), most: int = 16) -> Schedule:
    """The schedule of a seed; ``kinds`` restricts its faults."""
    dice = random.Random(seed)
    few = dice.choice([2, 2, 3, 3, 3, 4, 4, 5])
    agents = few if dice.random() < 0.95 else dice.randint(6, most)
    allowed = kinds or ("crash", "freeze", "cut", "lossy", "twin", "leave", "late", "lie")
    faults: list[Fault] = []
    for _ in range(dice.choice([0, 1, 1, 2, 2, 3])):
        kind = dice.choice(allowed)
        fault = Fault(
            kind=kind,
            agent=dice.randrange(agents),
            at=round(CALM + dice.random() * STORM, 3),
            seconds=round(dice.choice([0.3, 1.0, 2.5, 4.0]) * (0.5 + dice.random()), 3),
            other=dice.choice([-1, dice.randrange(agents)]),
            one_way=dice.random() < 0.5,
            disk=dice.choice(["kept", "old", "torn", "lost"]),
            lie=dice.choice(LIES),
        )
        if kind == "lie" and (agents < 4 or any(f.kind == "lie" for f in faults)):
            continue
        if kind == "late":
            fault = replace(fault, at=0.0)
        faults.append(fault)
    return Schedule(
        seed=seed,
        agents=agents,
        topology=dice.choice(KINDS),
        rule=dice.choice(list(RULES)),
        latency=dice.choice([0.001, 0.02, 0.04, 0.15]),
        jitter=dice.choice([0.0, 0.01, 0.1]),
        duplicates=dice.choice([0.0, 0.0, 0.1]),
        clocks=dice.choice([0.0, 0.0, 86_400.0]),
        faults=tuple(sorted(faults, key=lambda fault: fault.at)),
    )
