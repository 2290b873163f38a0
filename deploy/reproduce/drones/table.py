"""Table 1: mean safe flight [m] of every policy in every world, ours beside the paper's."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from deploy.evaluate import MODES, Evaluation, Mode
from deploy.reproduce.claims import Claim, Findings, Options, bounded
from deploy.reproduce.drones.curves import curve, draw
from deploy.reproduce.drones.runs import ESTIMATORS, Run, plan
from deploy.reproduce.drones.training import assess, train
from sim.indoor.scenes import NAMES, TRAINED, UNSEEN

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
Matrix = NDArray[np.float64]


def study(
    options: Options,
    estimators: Sequence[str] = ESTIMATORS,
    budget: int = 4000 * EPISODE,
    flights: int = 100,
    jobs: int = 2,
    root: Path = Path("runs/drones"),
    tell: Callable[[str], None] = print,
) -> Findings:
    """Train, fly and compare.

    Args:
        options: where to write, how to say how far it is; ``seeds`` is not used: one seed.
        estimators: which of :data:`ESTIMATORS`.
        budget: environment steps of every agent.
        flights: per policy, world and mode.
        jobs: agents that learn at a time.
        root: where the runs live and are resumed.
        tell: takes lines that should stay.
    """
    claims, data, runs = [], {}, []
    for estimator in estimators:
        five = plan(root, estimator, budget, seed=1)
        train(five, jobs, options.say)
        assess(five, flights, jobs, options.say)
        for run in five:
            tell(f"{run.label}: {run.steps:,} steps in {run.seconds:.0f} s")
        found = _compare(five)
        for mode in MODES:
            claims += _claims(estimator, mode, found[mode])
        data[estimator] = _record(five, found)
        runs += five
    for mode in MODES:
        claims.append(_cells(mode, {name: np.array(data[name][mode]) for name in estimators}))
    return Findings(
        title=f"Drones: mean safe flight, {budget:,} steps of every drone, {flights} flights",
        claims=claims,
        notes=[
            "SA-i learned alone in world i; DCPG is one policy, the mean of four agents' "
            "parameters. All runs of an estimator have the same settings and the same number of "
            "steps of every drone; only Adam's step is 4e-4 in the swarm of four and 1e-4 (the "
            "paper's) alone, because the mean of four agents' steps is what moves a swarm. It "
            "falls in a line to 0 from the first round to the last.",
            "The paper does not say how its policies chose when they were judged: stochastic "
            "flights draw every action from the policy, greedy ones take the likeliest.",
            "The paper's worlds and drone are PEDRA's, ours are ours: compare ratios, not metres.",
        ],
        data=data,
        figures=[draw(runs, [name.removeprefix("indoor-") for name in TRAINED],
                      options.out / "fig3.png")],
    )  # fmt: skip


def _evaluation(run: Run) -> Evaluation:
    return msgspec.json.decode(run.folder.evaluation.read_bytes(), type=Evaluation)


def _compare(five: Sequence[Run]) -> dict[Mode, Matrix]:
    """(5, 6) mean safe flights by mode: SA-0 to SA-3 and DCPG, trained worlds first."""
    ordered = [*five[1:], five[0]]
    return {
        mode: np.array([[_evaluation(run).mean(w, mode) for w in NAMES] for run in ordered])
        for mode in MODES
    }


def _claims(estimator: str, mode: Mode, found: Matrix) -> list[Claim]:
    seen = len(TRAINED)
    paper = np.array(PAPER[estimator])
    claims = []
    for name, row, theirs in zip(
        ("SA-0", "SA-1", "SA-2", "SA-3", "DCPG"), found, paper, strict=True
    ):
        ours = " ".join(f"{v:.1f}" for v in row[:seen])
        unseen = " ".join(f"{v:.1f}" for v in row[seen:])
        print_ = " ".join(f"{v:.1f}" for v in theirs) + f", sum {theirs.sum():.1f}"
        text = f"{ours}, sum {row[:seen].sum():.1f}; unseen {unseen}"
        claims.append(Claim(f"{estimator}, {mode}: {name} [m]", print_, "", text, holds=True))
    sums, printed = found[:, :seen].sum(axis=1), paper.sum(axis=1)
    claims.append(
        bounded(
            f"{estimator}, {mode}: DCPG's sum / best SA's",
            float(sums[-1] / sums[:-1].max()),
            low=2.5,
            paper=f"{printed[-1] / printed[:-1].max():.1f}",
        )
    )
    margin = found[-1, seen:] / found[:-1, seen:].max(axis=0)
    for name, ratio in zip(UNSEEN, margin, strict=True):
        what = f"{estimator}, {mode}: unseen {name}, DCPG / best SA"
        claims.append(bounded(what, float(ratio), low=1.0))
    return claims


def _cells(mode: Mode, found: dict[str, Matrix]) -> Claim:
    """In how many worlds the swarm flies nearly as far as who learned there alone."""
    ratios = np.array([m[-1, : len(TRAINED)] / np.diag(m)[: len(TRAINED)] for m in found.values()])
    good, cells = int((ratios >= 0.9).sum()), ratios.size
    need = round(10 / 12 * cells)
    listed = ", ".join(
        f"{name} " + " ".join(f"{r:.2f}" for r in row)
        for name, row in zip(found, ratios, strict=True)
    )
    return Claim(
        f"{mode}: cells where DCPG >= 0.9 of SA-i in world i",
        "11 of 12",
        f">= {need} of {cells}",
        f"{good} of {cells} ({listed})",
        good >= need,
    )


def _record(five: Sequence[Run], found: dict[Mode, Matrix]) -> dict[str, Any]:
    """What the JSON keeps of an estimator."""
    names = [*(run.name for run in five[1:]), five[0].name]
    record: dict[str, Any] = {"policies": names, "worlds": list(NAMES)}
    record |= {str(mode): found[mode] for mode in MODES}
    record["flights"] = {run.name: msgspec.to_builtins(_evaluation(run).cells) for run in five}
    record["runs"] = {
        run.name: {
            "steps": run.steps,
            "seconds": round(run.seconds, 1),
            "rounds": run.config.rounds,
            "step": run.config.optimizer.step,
            "seed": run.config.seed,
            "curves": {a: curve(run.folder, a) for a in run.config.members},
        }
        for run in five
    }
    return record
