"""How far a policy has flown, in which world: what ``eval.json`` and a policy's header hold."""

from typing import Literal

import msgspec

Mode = Literal["greedy", "stochastic"]
MODES: tuple[Mode, ...] = ("greedy", "stochastic")


class Cell(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Flights in one world.

    Attributes:
        mode: how actions were chosen.
        flights: how many.
        mean, deviation: of their length [m], or of their sum of rewards.
        capped: share that was still flying after 1 km.
    """

    mode: Mode
    flights: int
    mean: float
    deviation: float
    capped: float


class Evaluation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What ``eval.json`` holds.

    Attributes:
        source: what flew.
        agent: whose parameters; None for the mean of all.
        measure: "m" or "return".
        seed: of the first world.
        cells: by world.
    """

    source: str
    agent: str | None
    measure: str
    seed: int
    cells: dict[str, list[Cell]]

    def mean(self, world: str, mode: Mode) -> float:
        """Mean of one cell."""
        return next(cell.mean for cell in self.cells[world] if cell.mode == mode)
