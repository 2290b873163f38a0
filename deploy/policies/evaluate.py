"""``swarm eval RUN``: how far the learned policy flies, in every world, greedy and stochastic.

The worlds are the six indoor scenes where the run's tasks are flights, else the run's own tasks.
Measured is the safe flight [m] where a world tells it, else the sum of rewards.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import wait
from multiprocessing import get_context
from multiprocessing.sharedctypes import SynchronizedArray
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from agent.config.experiment import AgentEntry, SwarmFile, Task, load
from agent.learning.pilot import Pilot, use_threads
from agent.learning.rollout import Choice, Observations
from agent.storage.runfolder import open_run
from deploy.flying.warmup import FLIGHT, warm_up
from deploy.policies.evaluation import MODES, Cell, Evaluation, Mode
from deploy.policies.flights import Flown, fly_quota
from deploy.process.pool import pool
from sim.indoor.content.scenes import NAMES, TRAINED
from swarm.errors import ConfigError

MOST_STEPS = 2500  # 1 km
SIDE_BY_SIDE = 20  # flights at a time
LOOK = 0.5  # [s] between two looks at how far the workers are


def worlds_of(config: SwarmFile | None) -> dict[str, Task]:
    """The worlds in which a run is evaluated, by name; of an exported policy (None): the scenes."""
    if config is None or any(entry.task.env == FLIGHT for entry in config.agents):
        return {name: Task(FLIGHT, {"scene": name}) for name in NAMES}
    return {_title(entry): entry.task for entry in config.agents}


def _title(entry: AgentEntry) -> str:
    settings = ", ".join(f"{key} {value}" for key, value in entry.task.kwargs.items())
    return f"{entry.id}: {settings}" if settings else entry.id


def evaluate(
    source: Path,
    agent: str | None = None,
    flights: int = 100,
    seed: int = 0,
    jobs: int = 0,
    scenes: Sequence[str] = (),
    tell: Callable[[str], None] = lambda line: None,
    show: Callable[[str, float], None] = lambda cell, share: None,
) -> Evaluation:
    """Fly a policy in all its worlds, a world and a mode to a process.

    Args:
        source: run folder or exported policy.
        agent: whose parameters of a run; None for the mean.
        flights: at least so many per world and mode.
        seed: of the worlds and of stochastic actions.
        jobs: processes; 0 for one per core.
        scenes: some of the worlds only.
        tell: takes a line after every cell.
        show: takes, again and again, the cell that is awaited and the share of all that is flown.

    Raises:
        ConfigError: no such run or world.
        CheckpointError: nothing to fly with.
    """
    config = None if source.suffix == ".safetensors" else load(open_run(source).config)
    worlds = worlds_of(config)
    for name in scenes:
        if name not in worlds:
            raise ConfigError(f'world "{name}": expected one of {", ".join(worlds)}')
    chosen = {name: task for name, task in worlds.items() if not scenes or name in scenes}
    Pilot.load(source, agent)  # a mistake is told before processes start
    warm_up(chosen.values())
    wanted = [(name, mode) for name in chosen for mode in MODES]
    cells: dict[str, list[Cell]] = {name: [] for name in chosen}
    distances = True
    context = get_context("spawn")
    shares = context.Array("d", len(wanted))
    with pool(jobs, _share_with_parent, shares) as workers:
        begun = [
            workers.submit(_cell, k, source, agent, chosen[name], mode, flights, seed)
            for k, (name, mode) in enumerate(wanted)
        ]
        for (name, mode), future in zip(wanted, begun, strict=True):
            while not wait([future], LOOK).done:
                show(f"{name} {mode}", float(np.mean(shares[:])))
            flown = future.result()
            cell, distances = _summary(mode, flown)
            cells[name].append(cell)
            tell(f"{name} {mode}: {cell.mean:.1f} ± {cell.deviation:.1f}")
    return Evaluation(str(source), agent, "m" if distances else "return", seed, cells)


_shares: "SynchronizedArray[float] | None" = None  # in a worker: of each cell, what is flown


def _share_with_parent(shares: "SynchronizedArray[float]") -> None:
    global _shares  # noqa: PLW0603  (how a pool hands its workers what cannot be pickled)
    _shares = shares


def _cell(
    number: int, source: Path, agent: str | None, task: Task, mode: Mode, flights: int, seed: int
) -> list[Flown]:
    """One world and one mode, in a process of its own."""
    use_threads(1)
    pilot = Pilot.load(source, agent, seed)
    worlds = min(flights, SIDE_BY_SIDE)
    envs: list[gymnasium.Env[Any, Any]] = [
        gymnasium.make(task.env, **task.kwargs) for _ in range(worlds)
    ]
    each = -(-flights // worlds)

    def tell(share: float) -> None:
        if _shares is not None:
            _shares[number] = share

    def act(seen: Observations) -> Choice:
        return pilot.choose(seen, mode == "greedy")

    try:
        return fly_quota(envs, act, each, MOST_STEPS, seed, tell)
    finally:
        for env in envs:
            env.close()


def _summary(mode: Mode, flown: list[Flown]) -> tuple[Cell, bool]:
    lengths = [flight.distance for flight in flown if flight.distance is not None]
    measured = lengths or [flight.value for flight in flown]
    cell = Cell(
        mode=mode,
        flights=len(flown),
        mean=float(np.mean(measured)),
        deviation=float(np.std(measured)),
        capped=float(np.mean([flight.capped for flight in flown])),
    )
    return cell, bool(lengths)


def print_evaluation(evaluation: Evaluation) -> None:
    """The matrix, mean ± standard deviation, and how many flights reached the cap."""
    what = "mean safe flight [m]" if evaluation.measure == "m" else "sum of rewards"
    whose = evaluation.agent or "mean of all agents"
    table = Table(title=escape(f"{what}: {Path(evaluation.source).name}, {whose}"))
    table.add_column("world")
    for mode in MODES:
        table.add_column(mode, justify="right")
        table.add_column("at the cap", justify="right")
    for world, cells in evaluation.cells.items():
        row = [world if world in TRAINED or evaluation.measure != "m" else f"{world} (unseen)"]
        for cell in cells:
            row += [f"{cell.mean:.1f} ± {cell.deviation:.1f}", f"{cell.capped:.0%}"]
        table.add_row(*row)
    Console(highlight=False).print(table)
