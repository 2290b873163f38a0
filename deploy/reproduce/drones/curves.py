"""Fig. 3: how far drones fly while they learn, in a swarm and alone."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from deploy.reproduce import figures
from deploy.reproduce.drones.record import Record


def draw(records: Mapping[str, Record], worlds: Sequence[str], path: Path) -> Path:
    """One row an estimator, one panel a world: the swarm's agent and the agent alone, by seed."""
    figure, axes = figures.canvas(len(worlds), len(records), size=(2.6, 2.2))
    for row, (estimator, found) in enumerate(records.items()):
        *alone, swarm = found.policies
        for column, world in enumerate(worlds):
            panel = axes[row, column]
            for seed in found.seeds:
                together = list(found.run(swarm, seed).curves.values())[column]
                (by_itself,) = found.run(alone[column], seed).curves.values()
                for (steps, lengths), colour, name in (
                    (together, figures.BLUE, "DCPG"),
                    (by_itself, figures.ORANGE, f"SA-{column}"),
                ):
                    once = name if seed == found.seeds[0] else None
                    panel.plot(np.array(steps) / 1000, lengths, color=colour, label=once)
            side = "mean safe flight [m]" if column == 0 else ""
            below = "thousand steps of a drone" if row == len(records) - 1 else ""
            figures.label(panel, f"{estimator.upper()}, {world}", below, side)
            panel.legend(loc="upper left")
    return figures.save(figure, path)
