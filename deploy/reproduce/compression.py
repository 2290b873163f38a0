"""Beyond the paper: half the bytes, a quarter of the bytes, and what they cost.

Grid worlds (a), (b), (c) and (e) with parameters sent as float32, as fp16 and as int8, both with
error feedback (:mod:`swarm.mixing.compression`).
"""

from pathlib import Path
from typing import Any, get_args

import numpy as np

from deploy.policies.scoring import Referee
from deploy.reproduce import figures
from deploy.reproduce.claims import Claim, Findings, Options, bounded
from deploy.reproduce.settings import grid_swarm
from deploy.simulate.simulator import simulate_together
from sim.tabular.mdp import Floats
from swarm.mixing.compression import CODECS, Compression
from swarm.mixing.rules import Mixing

LAYOUTS = ("a", "b", "c", "e")
KINDS: tuple[Compression, ...] = get_args(Compression)
COSTS_AT_MOST = 0.01  # of V/V*


def study(options: Options) -> Findings:
    """See the module's docstring."""
    seeds = 2 if options.quick else options.seeds
    shares: dict[str, dict[Compression, Floats]] = {}
    for i, layout in enumerate(LAYOUTS):
        shares[layout] = {}
        referee = Referee(grid_swarm(layout))
        for k, kind in enumerate(KINDS):
            share = (i + k / len(KINDS)) / len(LAYOUTS)
            options.say(f"({layout}) {kind}, {seeds} seeds", share)
            swarms = [
                grid_swarm(layout, seed=seed, mixing=Mixing(compression=kind))
                for seed in range(seeds)
            ]
            worst = [
                referee.judge(run.thetas, chances=False).share.min()
                for run in simulate_together(swarms)
            ]
            shares[layout][kind] = np.array(worst)
    theta = np.zeros(400, np.float32)
    size = {kind: len(CODECS[kind]().encode(theta)) for kind in KINDS}
    claims: list[Claim] = []
    for layout, found in shares.items():
        for kind in KINDS[1:]:
            lost = float(found["none"].mean() - found[kind].mean())
            what = f"({layout}) {kind}, {size[kind]} bytes (float32: {size['none']}): V/V* lost"
            claims.append(bounded(what, lost, high=COSTS_AT_MOST + (0.02 if options.quick else 0)))
    data: dict[str, Any] = {"bytes": size, "worst_agent_share_of_optimum": shares}
    return Findings(
        title=f"Compression: grid worlds, {seeds} seeds, worst agent",
        claims=claims,
        notes=["V/V* lost: mean over seeds with float32 less mean with the codec; "
               "negative: the codec did better, within the scatter of the seeds."],
        data=data,
        figures=[_draw(options, shares)],
    )  # fmt: skip


def _draw(options: Options, shares: dict[str, dict[Compression, Floats]]) -> Path:
    figure, axes = figures.canvas(1, size=(5.4, 3.2))
    panel, rng = axes[0, 0], np.random.default_rng(0)
    for place, found in enumerate(shares.values()):
        for k, (kind, values) in enumerate(found.items()):
            x = place + 0.25 * (k - 1)
            jitter = rng.uniform(-0.06, 0.06, values.size)
            panel.plot(x + jitter, values, ".", color=figures.COLOURS[k], alpha=0.5, markersize=5)
            panel.plot([x - 0.1, x + 0.1], [values.mean()] * 2, color=figures.COLOURS[k],
                       linewidth=2.5, label=kind if place == 0 else None)  # fmt: skip
    panel.set_xticks(range(len(shares)), [f"({layout})" for layout in shares])
    figures.label(panel, "Fewer bytes cost nothing", "grid world", "V/V* of the worst agent")
    panel.legend(title="on the wire", ncols=3)
    return figures.save(figure, options.out / "compression.png")
