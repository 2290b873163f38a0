"""One life of one simulated agent, and what outlives it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarm.mixing.rules import Mixer
from swarm.protocol.machine import Machine

Vector = NDArray[np.floating]
DIMENSION = 2


@dataclass
class Disk:
    """What outlives a process."""

    saved: list[dict[str, Any]] = field(default_factory=list)


@dataclass
class Process:
    """One life of one agent."""

    agent: str
    life: str
    machine: Machine
    mixer: Mixer
    theta: Vector
    base: Vector  # theta with which this life began
    steps: Vector
    alive: bool = True
    frozen: bool = False
    held: list[Callable[[], None]] = field(default_factory=list)  # what happens while frozen
    step: Vector = field(default_factory=lambda: np.zeros(DIMENSION))
    sent: Vector = field(default_factory=lambda: np.zeros(DIMENSION))
    busy: bool = False
    woken: int = 0
    ended: str = ""
    rounds: list[tuple[float, int, tuple[str, ...], tuple[str, ...]]] = field(default_factory=list)
    flows: dict[tuple[str, int], Vector] = field(default_factory=dict)  # by other life and round
    said: list[tuple[float, str, str]] = field(default_factory=list)
    offences: list[str] = field(default_factory=list)
