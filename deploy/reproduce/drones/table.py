"""Table 1: mean safe flight [m] of every policy in every world, ours beside the paper's."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from agent.storage.runs import RUNS
from deploy.policies.evaluation import MODES, Mode
from deploy.reproduce.claims import Claim, Findings, Options, bounded, provenance
from deploy.reproduce.drones.curves import draw
from deploy.reproduce.drones.record import Made, Matrix, Record, check, record
from deploy.reproduce.drones.runs import ESTIMATORS, plan
from deploy.reproduce.drones.training import assess, train
from sim.indoor.content.scenes import NAMES, TRAINED, UNSEEN

EPISODE = 150  # steps; what an episode is taken to be where a budget counts episodes

# Table 1 of the paper, means: SA-0 to SA-3, DCPG, in Env 0 to 3.
PAPER = {
    "reinforce": [
        [15.9, 4.5, 4.1, 3.6], [3.0, 55.4, 9.7, 8.1], [1.5, 0.8, 21.1, 2.0], [2.3, 0.8, 8.6, 40.1],
        [25.2, 67.9, 40.5, 61.8],
    ],
    "a2c": [
        [21.8, 7.0, 15.1, 14.9], [1.3, 54.1, 2.8, 6.4], [1.8, 3.9, 105.2, 9.9],
        [1.1, 1.4, 15.8, 78.6], [25.2, 50.1, 165.8, 159.6],
    ],
    "ppo": [
        [28.3, 11.2, 8.7, 13.5], [1.1, 75.3, 1.6, 1.6], [2.5, 3.0, 63.2, 15.6],
        [1.9, 1.2, 14.3, 139.0], [26.3, 66.7, 144.0, 195.2],
    ],
}  # fmt: skip


def study(
    options: Options,
    estimators: Sequence[str] = ESTIMATORS,
    budget: int = 4000 * EPISODE,
    flights: int = 100,
    jobs: int = 2,
    root: Path = RUNS / "drones",
    tell: Callable[[str], None] = print,
    beside: Mapping[str, Record] | None = None,
) -> Findings:
    """Train, fly and compare.

    Args:
        options: where to write, how to say how far it is, seeds 1, 2, ...
        estimators: which of :data:`ESTIMATORS` are trained.
        budget: environment steps of every agent.
        flights: per policy, world and mode.
        jobs: agents that learn at a time.
        root: where the runs live and are resumed.
        tell: takes lines that should stay.
        beside: estimators that were trained elsewhere.

    Raises:
        ConfigError: what stands beside is not of as many steps, seeds and flights.
        SwarmError: a run failed, or was begun for another budget.
    """
    asked = {
        name: [plan(root, name, budget, seed) for seed in range(1, options.seeds + 1)]
        for name in ESTIMATORS
    }
    records = dict(beside or {})
    for estimator, found in records.items():
        check(found, asked[estimator], flights)
    for estimator in estimators:
        runs = [run for five in asked[estimator] for run in five]
        train(runs, jobs, options.say)
        assess(runs, flights, jobs, options.say)
        for run in runs:
            tell(f"{run.label}: {run.steps:,} steps in {run.seconds:.0f} s")
        made = msgspec.convert(provenance(options, 0.0), Made)
        records[estimator] = Record([record(run) for run in runs], made)
    records = {name: records[name] for name in ESTIMATORS if name in records}
    flown = f"{flights} flights"
    if options.seeds > 1:
        flown += f", mean of {options.seeds} seeds"
    claims = [
        claim
        for name, found in records.items()
        for mode in MODES
        for claim in _claims(name, mode, found.matrices(mode))
    ]
    for mode in MODES:
        means = {name: found.matrices(mode).mean(axis=0) for name, found in records.items()}
        claims.append(_cells(mode, means))
    return Findings(
        title=f"Drones: mean safe flight, {budget:,} steps of every drone, {flown}",
        claims=claims,
        notes=[
            "SA-i learned alone in world i; DCPG is one policy, the mean of four agents' "
            "parameters. All runs of an estimator have the same settings and the same number of "
            "steps of every drone; only Adam's step is 4e-4 in the swarm of four and 1e-4 (the "
            "paper's) alone, because the mean of four agents' steps is what moves a swarm. It "
            "falls in a line to 0 from the first round to the last.",
            "With several seeds the matrix is their mean, every claim is about that mean, and what "
            "each seed alone comes to stands beside it in parentheses.",
            "The paper does not say how its policies chose when they were judged: stochastic "
            "flights draw every action from the policy, greedy ones take the likeliest.",
            "The paper's worlds and drone are PEDRA's, ours are ours: compare ratios, not metres.",
            *(f"{name}: {found.made}; {_times(found)}" for name, found in records.items()),
        ],
        data={name: _data(found) for name, found in records.items()},
        figures=[draw(records, [name.removeprefix("indoor-") for name in TRAINED],
                      options.out / "fig3.png")],
    )  # fmt: skip


def _ratio(found: Matrix) -> float:
    """DCPG's sum over the trained worlds, by that of the best single agent."""
    sums = found[:, : len(TRAINED)].sum(axis=1)
    return float(sums[-1] / sums[:-1].max())


def _margin(found: Matrix) -> Matrix:
    """DCPG's flights in the unseen worlds, by those of the best single agent."""
    unseen = found[:, len(TRAINED) :]
    return np.asarray(unseen[-1] / unseen[:-1].max(axis=0))


def _beside(claim: Claim, each: Sequence[float]) -> Claim:
    """The claim with what each seed alone comes to, if there are several."""
    if len(each) == 1:
        return claim
    listed = ", ".join(f"{value:.2f}" for value in each)
    return msgspec.structs.replace(claim, ours=f"{claim.ours} ({listed})")


def _claims(estimator: str, mode: Mode, found: Matrix) -> list[Claim]:
    """What is claimed of (seeds, 5, 6) mean safe flights."""
    seen = len(TRAINED)
    mean, paper = found.mean(axis=0), np.array(PAPER[estimator])
    claims = []
    for name, row, theirs in zip(
        ("SA-0", "SA-1", "SA-2", "SA-3", "DCPG"), mean, paper, strict=True
    ):
        ours = " ".join(f"{v:.1f}" for v in row[:seen])
        unseen = " ".join(f"{v:.1f}" for v in row[seen:])
        print_ = " ".join(f"{v:.1f}" for v in theirs) + f", sum {theirs.sum():.1f}"
        text = f"{ours}, sum {row[:seen].sum():.1f}; unseen {unseen}"
        claims.append(Claim(f"{estimator}, {mode}: {name} [m]", print_, "", text, holds=True))
    what = f"{estimator}, {mode}: DCPG's sum / best SA's"
    ratio = bounded(what, _ratio(mean), low=2.5, paper=f"{_ratio(paper):.1f}")
    claims.append(_beside(ratio, [_ratio(one) for one in found]))
    for i, world in enumerate(UNSEEN):
        what = f"{estimator}, {mode}: unseen {world}, DCPG / best SA"
        margin = bounded(what, float(_margin(mean)[i]), low=1.0)
        claims.append(_beside(margin, [float(_margin(one)[i]) for one in found]))
    return claims


def _cells(mode: Mode, found: dict[str, Matrix]) -> Claim:
    """In how many worlds the swarm flies nearly as far as who learned there alone.

    Args:
        mode: how actions were chosen.
        found: (5, 6) mean safe flights by estimator.
    """
    ratios = np.array([m[-1, : len(TRAINED)] / np.diag(m)[: len(TRAINED)] for m in found.values()])
    good, cells = int((ratios >= 0.9).sum()), ratios.size
    need = round(10 / 12 * cells)
    listed = ", ".join(
        f"{name} " + " ".join(f"{r:.3f}" for r in row)
        for name, row in zip(found, ratios, strict=True)
    )
    return Claim(
        f"{mode}: cells where DCPG >= 0.9 of SA-i in world i",
        "11 of 12",
        f">= {need} of {cells}",
        f"{good} of {cells} ({listed})",
        good >= need,
    )


def _times(found: Record) -> str:
    """How long its runs learned."""
    return "learned in " + ", ".join(f"{run.policy} {run.seconds:.0f} s" for run in found.runs)


def _data(found: Record) -> dict[str, Any]:
    """What the JSON keeps of an estimator: its record, and the mean matrices to read."""
    data: dict[str, Any] = {"policies": found.policies, "worlds": list(NAMES)}
    data |= {str(mode): found.matrices(mode).mean(axis=0) for mode in MODES}
    kept: dict[str, Any] = msgspec.to_builtins(found)
    return data | kept
