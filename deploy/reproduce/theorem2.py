"""Theorem 2: where tasks share their transitions, DCPG finds the global optimum of the sum.

Random worlds in which N tasks differ in rewards alone (in [0, 1]), explored from a uniform start:
Assumption 2 holds, and the sum of the tasks is N times one world with the mean reward, whose best
policy is known.  For each epsilon, lambda is the theorem's ``epsilon / (2 N ||d / mu||)`` for the
largest mismatch ``||d / mu||`` of all worlds; agents start from random parameters, equal within a
swarm.  Beside them the chain of example 2, where transitions differ: there a policy is stationary
and no optimum, and above a critical step two agents that start near it converge to it.

The steps are practical ones; the theorem's own (in the table) would take some 10^9 rounds.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from agent.config.experiment import SwarmFile
from agent.learning.estimators import Exact
from agent.learning.optimizers import Sgd
from agent.learning.policies import Tabular, softmax
from deploy.reproduce import figures
from deploy.reproduce.claims import Claim, Findings, Options, at_most, bounded
from deploy.reproduce.examples import TILT, critical_step, pure_value, trap_swarm
from deploy.reproduce.settings import random_worlds, unnamed_agents
from deploy.simulate.simulator import Vectors, build_models, simulate_together
from deploy.simulate.worlds import Worlds
from sim.tabular.chain import S3
from sim.tabular.mdp import FiniteMDP, Floats
from sim.tabular.optimum import optimal_policy
from swarm.mixing.weights import Topology, graph, spectrum, weight_matrix

GAMMA, N, S, A = 0.8, 4, 4, 3
STEPS = {1.0: 0.5, 0.3: 0.3, 0.1: 0.2}  # by epsilon, of a sum of N values of at most 5 each
EVERY = 50  # rounds between evaluations
BEYOND = 1.5  # critical steps of the run that is trapped
ROUNDING = 1e-12  # of derivatives of values near 1


def best_of_sum(tasks: list[FiniteMDP]) -> tuple[float, float]:
    """V* of the sum, and the mismatch ``max_s d*(s) / ((1 - gamma) mu(s))``."""
    mean = FiniteMDP(
        successors=tasks[0].successors,
        probabilities=tasks[0].probabilities,
        rewards=np.mean([task.rewards for task in tasks], axis=0),
        start=tasks[0].start,
        terminal=tasks[0].terminal,
        gamma=GAMMA,
    )
    policy = optimal_policy(mean)
    mismatch = (mean.visitation(policy) / ((1 - GAMMA) * mean.start)).max()
    return len(tasks) * mean.value(policy), float(mismatch)


def theorem_step(lambda_: float, sigma_2: float, sigma_n: float) -> float:
    """The largest step that the theorem allows."""
    smooth = N * (8 / (1 - GAMMA) ** 3 + 2 * lambda_ / S)
    steep = 2 * N * lambda_ + N / (1 - GAMMA) ** 2
    return min(1 + sigma_n, lambda_ * N * (1 - sigma_2) / (4 * S * A * steep)) / smooth


def study(options: Options) -> Findings:
    """See the module's docstring."""
    n_worlds, rounds = (3, 2000) if options.quick else (options.seeds, 10_000)
    seeds = [np.random.default_rng((2, world)) for world in range(n_worlds)]
    tasks = [random_worlds(rng, N, (S, A), GAMMA, shared=True) for rng in seeds]
    starts = [np.tile(rng.normal(0, 0.5, S * A), (N, 1)) for rng in seeds]
    bests, mismatches = zip(*map(best_of_sum, tasks), strict=True)
    members = tuple(agent.id for agent in unnamed_agents(N))
    ring = spectrum(weight_matrix(graph(Topology(), members), members))
    claims: list[Claim] = []
    courses: dict[float, Floats] = {}
    for k, (epsilon, step) in enumerate(STEPS.items()):
        lambda_ = epsilon / (2 * N * max(mismatches))
        config = SwarmFile(
            name="theorem2",
            agents=unnamed_agents(N),
            estimator=Exact(gamma=GAMMA, entropy_weight=lambda_),
            policy=Tabular(precision="float64"),
            optimizer=Sgd(step=step),
            rounds=rounds,
        )

        def say(round_: int, k: int = k, epsilon: float = epsilon) -> None:
            options.say(f"epsilon {epsilon}, round {round_}", (k + round_ / rounds) / len(STEPS))

        gaps = Gaps(tasks, bests, say)
        simulate_together([config] * n_worlds, models=tasks, initial=starts, observe=gaps)
        courses[epsilon] = np.minimum.accumulate(gaps.course)
        theirs = theorem_step(lambda_, ring.second, ring.smallest)
        what = f"epsilon {epsilon}, step {step} (theorem's: {theirs:.0e}): gap in the worst world"
        claims.append(at_most(what, courses[epsilon][-1].max(), epsilon, f"<= {epsilon}"))
    claims += chain()
    data: dict[str, Any] = {"final_gaps": {str(e): gaps[-1] for e, gaps in courses.items()}}
    return Findings(
        title=f"Theorem 2: {N} agents, shared transitions, {n_worlds} worlds, {rounds} rounds",
        claims=claims,
        notes=["Gap: V* of the sum less what the worst agent's policy is worth; smallest so far."],
        data=data,
        figures=[_draw(options, courses)],
    )


class Gaps:
    """Watches how far the worst agent of each swarm is from V*; ``course`` is (K, worlds)."""

    def __init__(
        self,
        tasks: list[list[FiniteMDP]],
        bests: tuple[float, ...],
        say: Callable[[int], None],
    ) -> None:
        # Agent i's policy in task j of world w stands at (w N + i) N + j.
        self._everywhere = Worlds([task for world in tasks for task in world * N])
        self._bests, self._say = np.array(bests), say
        self.course: list[Floats] = []

    def __call__(self, round_: int, thetas: list[Vectors]) -> None:
        if round_ % EVERY == 0:
            self._say(round_)
            policies = softmax(np.concatenate(thetas).reshape(-1, S, A)).repeat(N, axis=0)
            sums = self._everywhere.values(policies).reshape(-1, N, N).sum(axis=2)
            self.course.append(self._bests - sums.min(axis=1))


def chain() -> list[Claim]:
    """Without Assumption 2: the chain of example 2, where the even policy is stationary and worst.

    Neither claim hangs on rounding: the first is about derivatives; in the second the even policy
    attracts agents that start off it (:func:`deploy.reproduce.examples.critical_step`).
    """
    p = 0.75
    config = trap_swarm("dcpg", BEYOND * critical_step(p, GAMMA), 500, p, GAMMA)
    models, even = build_models(config), np.full((5, 2), 0.5)
    steepest = np.abs(sum(model.gradient(even, 0.0) for model in models)).max()
    start = np.zeros((2, 10))
    start[:, 2 * S3] = TILT
    found = simulate_together([config], initial=[start])[0].thetas.reshape(2, 5, 2)
    values = [sum(model.value(policy) for model in models) for policy in (even, *softmax(found))]
    gaps = [pure_value(p, GAMMA) - value for value in values]
    where = "example 2 (transitions differ)"
    return [
        at_most(f"{where}, even policy: largest derivative of the sum", steepest, ROUNDING, "0"),
        bounded(f"{where}, even policy: gap", gaps[0], low=0.1, paper="not optimal"),
        bounded(
            f"{where}, from chance {softmax(start[0].reshape(5, 2))[S3, 0]:.3f} of left "
            f"at {BEYOND:g} critical steps: gap",
            min(gaps[1:]), low=0.1, paper="may be trapped",
        ),
    ]  # fmt: skip


def _draw(options: Options, courses: dict[float, Floats]) -> Path:
    figure, axes = figures.canvas(1, size=(5.0, 3.4))
    panel = axes[0, 0]
    for (epsilon, gaps), colour in zip(courses.items(), figures.COLOURS, strict=False):
        rounds = np.maximum(EVERY * np.arange(len(gaps)), 1)
        panel.loglog(rounds, gaps, color=colour, alpha=0.3, linewidth=0.8)
        panel.loglog(rounds, gaps.max(axis=1), color=colour, label=f"ε = {epsilon}: worst world")
        panel.axhline(epsilon, color=colour, linestyle="--", linewidth=1)
    figures.label(
        panel, "Shared transitions: gap falls below ε (- -)", "round", "min (V* − V), worst agent"
    )
    panel.legend(loc="lower left")
    return figures.save(figure, options.out / "theorem2.png")
