"""Beyond the paper: one of six agents turns, and sends parameters that are not its own.

Six agents in a complete graph learn grid world (a), starting anywhere half of the time.  After some
hundred rounds one of two agents of the same task begins to send something else (its task is still
learned by its twin), within the norm that :class:`swarm.protocol.guard.Guard` lets pass.  Every
attack meets every option of :mod:`swarm.mixing.robust`; the honest agents' policies are judged.
"""

from typing import Any

import numpy as np

from agent.config.experiment import StartMixing, SwarmFile
from deploy.policies.scoring import Referee
from deploy.reproduce import figures
from deploy.reproduce.claims import Claim, Findings, Options, noted
from deploy.reproduce.settings import grid_swarm
from deploy.simulate.simulator import simulate_together
from sim.tabular.gridworld import LAYOUTS
from swarm.memory import Attack, Faults, Poison
from swarm.mixing.robust import Robust
from swarm.mixing.rules import Mixing
from swarm.mixing.weights import Topology

AGENTS, TRAITOR = 6, 4  # drone3 and drone4 share a task
SEEDS = 2  # at most
DEFENCES = {
    "plain": Robust(),
    "clip": Robust("clip", radius=1.0),
    "trimmed mean": Robust("trimmed-mean", trim=1),
}
ATTACKS: dict[str, tuple[Attack, float] | None] = {
    "nobody": None,
    "opposite": ("opposite", 4.0),
    "noise": ("noise", 3.0),
    "shift": ("shift", 5.0),
}
KEEPS, AGAINST = "clip", ("nobody", "noise", "shift")  # the defence that must hold


def study(options: Options) -> Findings:
    """See the module's docstring."""
    rounds, first = (300, 200) if options.quick else (1000, 400)
    seeds = range(1 if options.quick else min(SEEDS, options.seeds))
    referee = Referee(_swarm(Robust(), 0, rounds))
    n_tasks = LAYOUTS["a"].n_tasks
    claims, data = [], {}
    shares: dict[str, list[float]] = {defence: [] for defence in DEFENCES}
    for k, (attack, how) in enumerate(ATTACKS.items()):
        options.say(f"attack: {attack}", k / len(ATTACKS))
        poison = None if how is None else Poison((f"drone{TRAITOR}",), *how, first)
        swarms = [_swarm(robust, seed, rounds) for robust in DEFENCES.values() for seed in seeds]
        runs = simulate_together(swarms, faults=Faults(poison=poison))
        for i, defence in enumerate(DEFENCES):
            part = runs[i * len(seeds) : (i + 1) * len(seeds)]
            scores = [referee.judge(np.delete(run.thetas, TRAITOR, axis=0)) for run in part]
            solved = [int(score.solved.min()) for score in scores]
            worth = [float(score.share.min()) for score in scores]
            shares[defence].append(float(np.mean(worth)))
            data[f"{attack}/{defence}"] = {"solved": solved, "share": worth}
            claims.append(_claim(attack, defence, solved, worth, n_tasks, options.quick))
    return Findings(
        title=f"Poison: one of {AGENTS} agents turns in round {first} of {rounds}, "
        f"{len(seeds)} seeds",
        claims=claims,
        notes=[
            "Solved and V/V* are of the worst honest agent.",
            "Who pulls everybody the same way for ever (opposite: to even policies) defeats all "
            "defences here: a bounded pull that never turns adds up.",
        ],
        data=data,
        figures=[_draw(options, shares)],
    )


def _swarm(robust: Robust, seed: int, rounds: int) -> SwarmFile:
    return grid_swarm(
        "a", AGENTS, seed=seed, rounds=rounds, topology=Topology(kind="complete"),
        start_mixing=StartMixing(0.5, rounds), mixing=Mixing(robust=robust),
    )  # fmt: skip


def _claim(
    attack: str, defence: str, solved: list[int], worth: list[float], n_tasks: int, quick: bool
) -> Claim:
    """One attack on one defence."""
    required, holds = "", True
    if attack == "nobody" or (defence == KEEPS and attack in AGAINST):
        required, holds = f"all {n_tasks} solved", min(solved) == n_tasks
    elif defence == "plain":
        required, holds = "fails", max(solved) < n_tasks
    text = f"{min(solved)} of {n_tasks} solved; V/V* {np.mean(worth):.3f}"
    claim = Claim(f"attack: {attack}; {defence}", "", required, text, holds)
    return noted(claim) if quick else claim


def _draw(options: Options, shares: dict[str, list[float]]) -> Any:
    figure, axes = figures.canvas(1, 1, size=(6.0, 3.2))
    panel, places = axes[0, 0], np.arange(len(ATTACKS))
    colours = (figures.RED, figures.BLUE, figures.ORANGE)
    for i, ((defence, values), colour) in enumerate(zip(shares.items(), colours, strict=True)):
        panel.bar(places + 0.27 * (i - 1), values, 0.25, label=defence, color=colour)
    panel.axhline(0.0, color="black", linewidth=0.8)
    panel.set_xticks(places, [f"attack: {attack}" for attack in ATTACKS])
    panel.set_ylabel("V/V* of the worst honest agent")
    panel.legend(frameon=False)
    return figures.save(figure, options.out / "poison.png")
