"""Fig. 3: how far drones fly while they learn, in a swarm and alone."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agent.runfolder import RunFolder
from deploy.reproduce import figures
from deploy.reproduce.drones.runs import SWARM, Run

POINTS = 30  # of a curve
Curve = tuple[NDArray[np.float64], NDArray[np.float64]]  # steps, mean safe flight [m]


def curve(folder: RunFolder, agent: str) -> Curve:
    """Mean safe flight while learning: every point is the mean of a thirtieth of the run."""
    reports = [r for r in folder.reports(agent) if r.distance is not None]
    pieces = np.array_split(np.arange(len(reports)), min(POINTS, len(reports)))
    steps = [reports[piece[-1]].steps for piece in pieces]
    lengths = [np.mean([reports[i].distance or 0.0 for i in piece]) for piece in pieces]
    return np.array(steps, np.float64), np.array(lengths, np.float64)


def draw(runs: Sequence[Run], worlds: Sequence[str], path: Path) -> Path:
    """One row an estimator, one panel a world: the swarm's agent and the agent alone, by seed."""
    estimators = list(dict.fromkeys(run.estimator for run in runs))
    seeds = list(dict.fromkeys(run.config.seed for run in runs))
    figure, axes = figures.canvas(len(worlds), len(estimators), size=(2.6, 2.2))
    by_key = {(run.estimator, run.name, run.config.seed): run for run in runs}
    for row, estimator in enumerate(estimators):
        for column, world in enumerate(worlds):
            panel = axes[row, column]
            for seed in seeds:
                together = by_key[estimator, SWARM, seed]
                alone = by_key[estimator, f"sa-{column}", seed]
                for run, agent, colour, name in (
                    (together, together.config.members[column], figures.BLUE, "DCPG"),
                    (alone, alone.config.members[0], figures.ORANGE, f"SA-{column}"),
                ):
                    steps, lengths = curve(run.folder, agent)
                    once = name if seed == seeds[0] else None
                    panel.plot(steps / 1000, lengths, color=colour, label=once)
            side = "mean safe flight [m]" if column == 0 else ""
            below = "thousand steps of a drone" if row == len(estimators) - 1 else ""
            figures.label(panel, f"{estimator.upper()}, {world}", below, side)
            panel.legend(loc="upper left")
    return figures.save(figure, path)
