"""Sec. 5.1 of the paper: five multi-task grid worlds, and the picture of Fig. 2.

For each layout, over seeds: DCPG with the settings of the notes; the share of seeds in which every
agent's policy solves the target tasks (P(goal) - P(obstacle) > 1/2, computed exactly); and V/V*,
where V* is the true optimum of the sum, certified.  Beside them each task's agent on its own: what
it reaches in its own task, and what its policy is worth to all.
"""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from agent.learning.policies import softmax
from deploy.policies.scoring import Referee, Scores
from deploy.reproduce import figures
from deploy.reproduce.claims import Claim, Findings, Options, bounded
from deploy.reproduce.settings import grid_agents, grid_swarm
from deploy.simulate.simulator import Run, simulate_together
from sim.tabular.gridworld import LAYOUTS
from swarm.mixing.weights import Topology

TARGETS = {"a": 4, "b": 4, "c": 3, "d": 6, "e": 6}  # tasks that the best policy solves
PAPER = {
    "a": "no conflict: finds all 4 goals",
    "b": "solvable conflict: all 4",
    "c": "unsolvable conflict: 3 of 4, the optimum",
    "d": "top left start: not optimal",
    "e": "top right start: optimal, all 6",
}
VALUES = {
    "a": (0.94, None),
    "b": (0.94, None),
    "c": (0.92, None),
    "d": (0.6, 0.7),
    "e": (0.94, None),
}
ALMOST_ALL, HARDLY_ANY = 0.95, 0.10
PATH = "#cfe8c6"
ROUTES = (figures.BLUE, figures.ORANGE, figures.GREEN, figures.PINK, figures.SKY, figures.BLACK)


def study(options: Options) -> Findings:
    """See the module's docstring."""
    seeds = 2 if options.quick else options.seeds
    claims: list[Claim] = []
    data: dict[str, Any] = {}
    shown: dict[str, Run] = {}
    for k, layout in enumerate(LAYOUTS):
        options.say(f"({layout}) {seeds} swarms", k / len(LAYOUTS))
        runs = simulate_together([grid_swarm(layout, seed=seed) for seed in range(seeds)])
        referee = Referee(runs[0].config)
        scores = [referee.judge(run.thetas) for run in runs]
        shown[layout] = runs[0]
        alone_now = f"({layout}) {seeds} x {LAYOUTS[layout].n_tasks} agents on their own"
        options.say(alone_now, (k + 0.5) / len(LAYOUTS))
        alone = _alone(layout, seeds)
        lonely = [referee.judge(run.thetas) for run in alone]
        claims += _claims(layout, referee, scores, lonely)
        data[layout] = {
            "optimum": referee.optimum.bound,
            "certified": referee.optimum.certified,
            "worst_agent_share_of_optimum": [s.share.min() for s in scores],
            "worst_agent_solved": [s.solved.min() for s in scores],
            "alone_share_of_optimum": [s.share for s in lonely],
            "alone_solved_own": [np.diag(s.margins) > 0.5 for s in lonely],
        }
    return Findings(
        title=f"Grid worlds (a) to (e): DCPG, 1000 rounds, {seeds} seeds",
        claims=claims,
        notes=[
            "The print gives no layouts; these were chosen because they show what it describes.",
            "Solved and V/V* are exact and of the worst agent's policy; "
            "V* comes from a dynamic program over cell and unfinished tasks, with a certificate.",
            "Assumption 2 does not hold in these worlds as described: an own goal or obstacle ends "
            "only that task's episode (notes, 8).",
        ],
        data=data,
        figures=[draw_fig2(shown, options.out / "fig2.png")],
    )


def _alone(layout: str, seeds: int) -> list[Run]:
    """The same agents without edges: one swarm of one agent per task, regrouped by seed."""
    whole = [grid_swarm(layout, seed=seed) for seed in range(seeds)]
    single = [
        msgspec.structs.replace(config, agents=(agent,), topology=Topology())
        for config in whole
        for agent in grid_agents(layout, len(config.agents))
    ]
    runs = simulate_together(single)
    size = len(whole[0].agents)
    return [
        Run(
            config,
            np.concatenate([run.thetas for run in runs[i * size : (i + 1) * size]]),
            np.hstack([run.values for run in runs[i * size : (i + 1) * size]]),
            np.zeros((config.rounds, size)),
        )
        for i, config in enumerate(whole)
    ]


def _claims(
    layout: str, referee: Referee, scores: list[Scores], lonely: list[Scores]
) -> list[Claim]:
    target, n_tasks = TARGETS[layout], LAYOUTS[layout].n_tasks
    name = f"({layout})"
    solved = float(np.mean([s.solved.min() >= target for s in scores]))
    value = float(np.mean([s.share.min() for s in scores]))
    own = float(np.mean([(np.diag(s.margins) > 0.5).mean() for s in lonely]))
    sums = float(np.mean([s.share.mean() for s in lonely]))
    low, high = (None, HARDLY_ANY) if layout == "d" else (ALMOST_ALL, None)
    optimum = referee.optimum
    return [
        Claim(f"{name} V* of the sum", "", "certified", f"{optimum.bound:.4f}", optimum.certified),
        bounded(
            f"{name} seeds with {target} of {n_tasks} solved", solved, low, high, PAPER[layout]
        ),
        bounded(f"{name} mean V/V*", value, *VALUES[layout]),
        Claim(
            f"{name} agents alone: own task solved, V/V* of the sum",
            "",
            "below DCPG's V/V*",
            f"{own:.3f}, {sums:.3f}",
            bool(sums < value),
        ),
    ]


def draw_fig2(runs: dict[str, Run], path: Path) -> Path:
    """Fig. 2: goals, obstacles and the paths most followed, all tasks of a layout in one grid."""
    figure, axes = figures.canvas(3, 2, size=(3.3, 3.5))
    for panel, (layout, run) in zip(axes.flat, runs.items(), strict=False):
        _draw_layout(panel, layout, run)
    legend = axes[1, 2]
    legend.axis("off")
    marks = [
        ("s", "black", "start of every task"),
        ("s", figures.YELLOW, "goal (large number: its task)"),
        ("s", figures.RED, "obstacle (small number: its task)"),
        ("s", PATH, "cells on a path most followed"),
    ]
    marks += [("", colour, f"path of task {n}") for n, colour in enumerate(ROUTES, 1)]
    for marker, colour, what in marks:
        legend.plot([], [], marker or "-", color=colour, label=what, markersize=9)
    legend.legend(loc="center", fontsize=9, title="One policy for all tasks of a grid")
    return figures.save(figure, path)


def _draw_layout(panel: figures.Axes, layout: str, run: Run) -> None:
    plan, referee = LAYOUTS[layout], Referee(run.config)
    rows, columns = plan.size
    policy = softmax(run.thetas.mean(axis=0).reshape(rows * columns, -1))
    models = plan.models()
    colours = np.ones((rows, columns, 3))
    for model in models:
        for state in model.most_followed_path(policy):
            colours[divmod(state, columns)] = figures.rgb(PATH)
    for task in range(plan.n_tasks):
        for cell in plan.obstacles[task]:
            colours[cell] = figures.rgb(figures.RED)
    for goal in plan.goals:
        colours[goal] = figures.rgb(figures.YELLOW)
    panel.imshow(colours, extent=(-0.5, columns - 0.5, rows - 0.5, -0.5))
    panel.set_xticks(np.arange(columns + 1) - 0.5, [])
    panel.set_yticks(np.arange(rows + 1) - 0.5, [])
    panel.tick_params(length=0)
    for task, (goal, obstacles) in enumerate(zip(plan.goals, plan.obstacles, strict=True), 1):
        for cell in obstacles:
            shift = 0.22 if cell in plan.goals else 0.0
            panel.text(cell[1] + shift, cell[0] + shift, str(task), ha="center", va="center",
                       fontsize=6, color="black" if shift else "white")  # fmt: skip
        panel.text(goal[1], goal[0], str(task), ha="center", va="center", weight="bold")
    for number, model in enumerate(models):
        path = model.most_followed_path(policy)
        offset = 0.3 * (number / max(1, len(models) - 1) - 0.5)
        cells = np.array([divmod(state, columns) for state in path]) + offset
        panel.plot(cells[:, 1], cells[:, 0], color=ROUTES[number], linewidth=1.2)
        panel.plot(cells[-1, 1], cells[-1, 0], "o", color=ROUTES[number], markersize=3)
    panel.plot(plan.start[1], plan.start[0], "s", color="black", markersize=7)
    scores = referee.judge([run.thetas.mean(axis=0)])
    panel.set_title(f"({layout}) {scores.solved[0]} of {plan.n_tasks}, V/V* {scores.share[0]:.2f}")
    for side in panel.spines.values():
        side.set_visible(True)
