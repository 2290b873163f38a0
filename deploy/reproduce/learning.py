"""Beyond the paper: a start distribution that repairs (d), and actor-critic estimators.

*   In (d) all tasks start in a corner from which the first goals hide the later ones.  Starting
    anywhere with probability 0.8 in the first 600 of 1000 rounds repairs it; the values reported
    are those from the corner.
*   (a) is learned with A2C and PPO too, whose critics are part of what is mixed.
"""

from pathlib import Path
from typing import Any

import numpy as np

from agent.config.experiment import StartMixing, SwarmFile
from agent.learning.estimators import A2C, PPO, Estimator
from deploy.policies.scoring import Referee
from deploy.reproduce import figures
from deploy.reproduce.claims import Claim, Findings, Options, bounded
from deploy.reproduce.gridworld import TARGETS
from deploy.reproduce.settings import REINFORCE, grid_swarm
from deploy.simulate.simulator import Vectors, simulate_together
from sim.tabular.mdp import Floats

ANYWHERE = StartMixing(uniform=0.8, rounds=600)
COMMON: dict[str, Any] = {"gamma": 0.99, "entropy_weight": 0.03, "episodes": 10, "horizon": 200}
ESTIMATORS: dict[str, Estimator] = {
    "reinforce": REINFORCE,
    "a2c": A2C(**COMMON),
    "ppo": PPO(**COMMON),
    "a2c, trace 0.95": A2C(**COMMON, trace=0.95),
}
SAMPLES = 25


def study(options: Options) -> Findings:
    """See the module's docstring."""
    seeds = 2 if options.quick else options.seeds
    few = min(seeds, 5)
    swarms = {
        "(d) from the corner": [grid_swarm("d", seed=seed) for seed in range(few)],
        "(d) from anywhere first": [
            grid_swarm("d", seed=seed, start_mixing=ANYWHERE) for seed in range(seeds)
        ],
    }
    claims: list[Claim] = []
    curves: dict[str, Floats] = {}
    for name, configs in swarms.items():
        curves[name], solved = _learn(options, name, configs)
        repaired = name.endswith("first")
        what = f"{name}, {len(configs)} seeds: share with all {TARGETS['d']} tasks solved"
        claims.append(bounded(what, solved, 0.9 if repaired else None, None if repaired else 0.1))
    for name, estimator in ESTIMATORS.items():
        configs = [grid_swarm("a", seed=seed, estimator=estimator) for seed in range(few)]
        curves[f"(a) {name}"], solved = _learn(options, f"(a) {name}", configs)
        share = curves[f"(a) {name}"][-1].mean()
        what = f"(a) {name}, {few} seeds: all 4 solved, mean V/V* of the worst agent"
        bootstraps = name.endswith("0.95")  # from a critic that speaks for the mean of all tasks
        required = "worse" if bootstraps else "all"
        holds = solved == 1 or bootstraps
        claims.append(Claim(what, "", required, f"{solved:.2f}, {share:.3f}", holds))
    return Findings(
        title=f"Start-state mixing and estimators, {seeds} seeds",
        claims=claims,
        notes=[
            "All with the same step, episodes and ring; nothing is tuned.",
            "Bootstrapping (trace < 1) from a critic that is mixed over tasks hurts: in a table it "
            "can only speak for their mean.",
        ],
        data={"worst_agent_share_of_optimum": curves},
        figures=[_draw(options, curves)],
    )


def _learn(options: Options, name: str, configs: list[SwarmFile]) -> tuple[Floats, float]:
    """(SAMPLES + 1, seeds) V/V* of the worst agent; the share of seeds that solve all tasks."""
    referee, every = Referee(configs[0]), configs[0].rounds // SAMPLES
    curve: list[list[float]] = []

    def watch(round_: int, thetas: list[Vectors]) -> None:
        if round_ % every == 0:
            options.say(f"{name}, round {round_}")
            curve.append([float(referee.judge(t, chances=False).share.min()) for t in thetas])

    runs = simulate_together(configs, observe=watch)
    everything = len(configs[0].agents)
    solved = [referee.judge(run.thetas).solved.min() == everything for run in runs]
    return np.array(curve), float(np.mean(solved))


def _draw(options: Options, curves: dict[str, Floats]) -> Path:
    figure, axes = figures.canvas(2, size=(4.4, 3.3))
    for panel, mark in zip(axes[0], "da", strict=True):
        mine = {name: curve for name, curve in curves.items() if name.startswith(f"({mark})")}
        for (name, curve), colour in zip(mine.items(), figures.COLOURS, strict=False):
            at = np.linspace(0, 1000, len(curve))
            panel.plot(at, curve.mean(axis=1), color=colour, label=name[4:])
            panel.fill_between(at, curve.min(axis=1), curve.max(axis=1), color=colour, alpha=0.2,
                               linewidth=0)  # fmt: skip
        panel.legend(loc="lower right")
    figures.label(
        axes[0, 0], "(d): where flights start early on", "round", "V/V* of the worst agent"
    )
    figures.label(axes[0, 1], "(a): estimators, same step", "round", "V/V* of the worst agent")
    return figures.save(figure, options.out / "learning.png")
