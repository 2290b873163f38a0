"""Beyond the paper: messages that do not come, come late, or cannot cross a gap.

16 agents on a ring, tasks of grid world (a) in blocks of four.  Every message is lost with
probability 0.3, independently in each direction; every rule is run with every policy for what is
missing (:class:`swarm.mixing.rules.Mixing`).  Then delay, and a partition that heals.
"""

from pathlib import Path
from typing import Any, get_args

import numpy as np

from deploy.policies.scoring import Referee
from deploy.reproduce import figures
from deploy.reproduce.claims import Claim, Findings, Options, bounded, noted
from deploy.reproduce.settings import grid_swarm
from deploy.simulate.simulator import DivergenceError, Run, Vectors, simulate, simulate_together
from sim.tabular.mdp import Floats
from swarm.memory import Faults, Partition
from swarm.mixing.loss import Loss
from swarm.mixing.rules import RULES, Missing, Mixing, RuleName

AGENTS, LOSS = 16, 0.3
SEEDS = 2  # at most
POLICIES: tuple[Missing, ...] = get_args(Missing)
DELAYS = (1, 3)
STEADY: tuple[RuleName, ...] = (
    "dcpg",
    "exact-diffusion",
    "extra",
)  # rules that delay and partition are tried on


def study(options: Options) -> Findings:
    """See the module's docstring."""
    rounds, seeds = (200, 1) if options.quick else (1000, min(SEEDS, options.seeds))
    referee = Referee(grid_swarm("a", AGENTS))
    lossy = _lossy(options, rounds, seeds)
    shares = {
        pair: [float(referee.judge(run.thetas, chances=False).share.min()) for run in runs]
        for pair, runs in lossy.items()
    }
    means = {pair: float(np.mean(found)) for pair, found in shares.items()}
    claims = [
        bounded(
            f"{LOSS:.0%} loss, {rule}, {missing}: worst agent's V/V*",
            means[rule, missing],
            0.93 if (rule, missing) == ("extra", "symmetric") and not options.quick else None,
        )
        for rule, missing in means
    ]
    agreement = _agreement({missing: lossy["dcpg", missing] for missing in POLICIES})
    claims.append(noted(agreement) if options.quick else agreement)
    late = _late(options, referee, rounds)
    claims += [
        Claim(f"every message {delay} late, {rule}: worst agent's V/V*", "", "", how, True)
        for (rule, delay), how in late.items()
    ]
    split, gap = _split(options, rounds)
    for run, rule in zip(split, STEADY, strict=True):
        share = referee.judge(run.thetas, chances=False).share.min()
        apart, healed = run.consensus[gap.last].max(), run.consensus[-1].max()
        text = f"consensus error {apart:.1f} apart, {healed:.1f} at the end; V/V* {share:.3f}"
        what = f"cut in two from round {gap.first} to {gap.last}, {rule}"
        claims.append(Claim(what, "", "error shrinks again", text, bool(healed < apart)))
    data: dict[str, Any] = {
        "loss": {f"{rule}/{missing}": found for (rule, missing), found in shares.items()},
        "delay": {f"{rule}/{delay}": how for (rule, delay), how in late.items()},
    }
    return Findings(
        title=f"Faults: ring of {AGENTS}, tasks of (a) in blocks, {rounds} rounds, {seeds} seeds",
        claims=claims,
        notes=["Rules that remember (exact diffusion, EXTRA, tracking) need both ends of an edge "
               "to agree on whether it counts: the symmetric drop."],
        data=data,
        figures=[_draw(options, means, split, gap)],
    )  # fmt: skip


def _lossy(options: Options, rounds: int, seeds: int) -> dict[tuple[RuleName, Missing], list[Run]]:
    """What becomes of every rule and policy, by seed."""
    pairs = [(rule, missing) for rule in RULES for missing in POLICIES]
    found: dict[tuple[RuleName, Missing], list[Run]] = {pair: [] for pair in pairs}
    for seed in range(seeds):
        swarms = [
            grid_swarm(
                "a", AGENTS, seed=seed, rounds=rounds,
                mixing=Mixing(rule=rule, missing=missing), loss=Loss(LOSS, seed),
            )
            for rule, missing in pairs
        ]  # fmt: skip

        def watch(round_: int, thetas: list[Vectors], seed: int = seed) -> None:
            if round_ % 10 == 0:
                options.say(f"{len(pairs)} x {AGENTS} agents, seed {seed}, round {round_}")

        for pair, run in zip(pairs, simulate_together(swarms, observe=watch), strict=True):
            found[pair].append(run)
    return found


def _agreement(plain: dict[Missing, list[Run]]) -> Claim:
    """Under which policy plain DCPG's agents keep together best and worst.

    Consensus errors of the last fifth of the rounds tell the policies apart; what the worst agent
    is worth scatters more from seed to seed than from policy to policy.
    """
    errors = {
        missing: float(np.mean([run.consensus[-len(run.consensus) // 5 :].max(1) for run in runs]))
        for missing, runs in plain.items()
    }
    order = sorted(errors, key=lambda missing: errors[missing])
    return Claim(
        f"{LOSS:.0%} loss, dcpg: consensus error of the last fifth, smallest to largest",
        "", "stale first, symmetric last",
        ", ".join(f"{missing} {errors[missing]:.2f}" for missing in order),
        order[0] == "stale" and order[-1] == "symmetric",
    )  # fmt: skip


def _late(options: Options, referee: Referee, rounds: int) -> dict[tuple[RuleName, int], str]:
    """What becomes of each rule when every message is so many rounds late."""
    late = {}
    for rule in STEADY:
        for delay in DELAYS:
            options.say(f"{rule}, delay {delay}")
            config = grid_swarm("a", AGENTS, rounds=rounds, mixing=Mixing(rule=rule))
            try:
                with np.errstate(over="ignore", invalid="ignore"):
                    run = simulate(config, faults=Faults(delay=delay))
            except DivergenceError as error:
                late[rule, delay] = f"diverges ({error})"
            else:
                share = referee.judge(run.thetas, chances=False).share.min()
                late[rule, delay] = f"{share:.3f}"
    return late


def _split(options: Options, rounds: int) -> tuple[list[Run], Partition]:
    options.say("partition")
    swarms = [
        grid_swarm("a", AGENTS, rounds=rounds, mixing=Mixing(rule=rule, missing="symmetric"))
        for rule in STEADY
    ]
    members = swarms[0].members
    gap = Partition(
        int(0.2 * rounds), int(0.5 * rounds), (members[: AGENTS // 2], members[AGENTS // 2 :])
    )
    return simulate_together(swarms, faults=Faults(partitions=(gap,))), gap


def _draw(
    options: Options, means: dict[tuple[RuleName, Missing], float], split: list[Run], gap: Partition
) -> Path:
    figure, axes = figures.canvas(2, size=(4.6, 3.3))
    table: Floats = np.array([[means[rule, missing] for missing in POLICIES] for rule in RULES])
    panel = axes[0, 0]
    panel.imshow(table, cmap="cividis", vmin=0, vmax=1, aspect="auto")
    panel.grid(visible=False)
    panel.set_xticks(range(len(POLICIES)), POLICIES)
    panel.set_yticks(range(len(RULES)), RULES)
    for (row, column), share in np.ndenumerate(table):
        colour = "black" if share > 0.5 else "white"
        panel.text(column, row, f"{share:.2f}", ha="center", va="center", color=colour)
    figures.label(panel, f"V/V* of the worst agent at {LOSS:.0%} loss", "a missing message ...", "")
    panel = axes[0, 1]
    panel.axvspan(gap.first, gap.last, color="#eeeeee", label="cut in two")
    for run, colour in zip(split, figures.COLOURS, strict=False):
        errors = run.consensus.max(axis=1)
        panel.plot(errors, color=colour, label=run.config.mixing.rule)
    figures.label(panel, "A partition heals", "round", "largest ‖θᵢ − mean θ‖")
    panel.legend()
    return figures.save(figure, options.out / "faults.png")
