"""Theorem 1: with exact gradients every agent approaches a stationary point of the sum.

Eight agents, each in a random world of its own (transitions and rewards differ, rewards lie in
[0, 1] as the theorem has them), from equal parameters.  For four graphs, at the largest step that
the theorem allows and at larger ones, this measures

*   ``min_k ||1/N sum_j grad V_j(theta_i^k)||^2`` of the worst agent i, beside the right-hand side
    with the constants of the proof (corrected: the regulariser's term is ``16 lambda^2``);
*   the consensus error beside ``alpha D / (1 - sigma_2)`` of Lemma 2;
*   the Lyapunov function ``xi = -sum_i L_i(theta_i) + ||theta||^2_{I-W} / (2 alpha)``.
"""

from pathlib import Path
from typing import Any

import numpy as np

from agent.config.experiment import SwarmFile
from agent.learning.estimators import Exact
from agent.learning.optimizers import Sgd
from agent.learning.policies import Tabular, softmax
from deploy.reproduce import figures
from deploy.reproduce.claims import Claim, Findings, Options, at_most, bounded
from deploy.reproduce.settings import random_worlds, unnamed_agents
from deploy.simulate.simulator import Vectors, simulate_together
from deploy.simulate.worlds import Worlds
from sim.tabular.mdp import FiniteMDP, Floats, relative_entropy
from swarm.mixing.consensus import consensus_errors
from swarm.mixing.weights import Kind, Spectrum, Topology, graph, spectrum, weight_matrix

GAMMA, LAMBDA, N = 0.5, 1e-3, 8
SHAPE = (6, 3)  # states, actions
GRAPHS: tuple[Kind, ...] = ("complete", "exponential", "ring", "path")
ROUNDING = 1e-12  # of sums of eight values near 1
TIMES = (1, 10, 100, 1000)  # steps, in units of the theorem's largest


def largest_step(weights: Spectrum) -> float:
    """The theorem's bound on alpha, with sigma_N the smallest eigenvalue (notes, 5)."""
    return (1 + weights.smallest) / (16 * N / (1 - GAMMA) ** 3 + 4 * N * LAMBDA / SHAPE[0])


GRADIENT_BOUND = 2 * N * LAMBDA + N / (1 - GAMMA) ** 2  # D


def consensus_bound(alpha: float, weights: Spectrum) -> float:
    """Lemma 2."""
    return alpha * GRADIENT_BOUND / weights.gap


def gradient_bound(alpha: float, weights: Spectrum, rounds: Floats) -> Floats:
    """Right-hand side of Theorem 1 for K = ``rounds``, with the proof's constants."""
    start = 16 * N / (1 - GAMMA) / (rounds * alpha)  # the regulariser is 0 at the start
    ball = 512 * GRADIENT_BOUND**2 * alpha**2 / weights.gap**2 / (1 - GAMMA) ** 6
    return np.asarray(start + 16 * LAMBDA**2 + ball)


def swarm_of(kind: Kind, alpha: float, rounds: int) -> SwarmFile:
    """N agents that start from equal parameters."""
    return SwarmFile(
        name="theorem1",
        agents=unnamed_agents(N),
        estimator=Exact(gamma=GAMMA, entropy_weight=LAMBDA),
        policy=Tabular(precision="float64"),
        optimizer=Sgd(step=alpha),
        topology=Topology(kind=kind),
        rounds=rounds,
    )


class Probe:
    """What is measured along the way.

    Attributes:
        rounds: at which gradient norms were taken.
        norms: (K, C) squared norm of the mean gradient at the worst agent's parameters.
        consensus: (C,) largest consensus error so far.
        rises: (C,) largest increase of the Lyapunov function from one round to the next.
    """

    def __init__(self, models: list[FiniteMDP], weights: list[Floats], steps: list[float]) -> None:
        cases = len(steps)
        self._own = Worlds(models * cases)
        self._pairs = Worlds([model for model in models for _ in range(N)] * cases)
        self._weights, self._steps = weights, steps
        self._lyapunov: Floats | None = None
        self.rounds: list[int] = []
        self.norms: list[Floats] = []
        self.consensus, self.rises = np.zeros(cases), np.full(cases, -np.inf)

    def __call__(self, round_: int, thetas: list[Vectors]) -> None:
        stacked = np.stack(thetas).astype(np.float64)  # (C, N, d)
        errors = [consensus_errors(theta).max() for theta in stacked]
        self.consensus = np.maximum(self.consensus, errors)
        now = self._xi(stacked)
        if self._lyapunov is not None:
            self.rises = np.maximum(self.rises, now - self._lyapunov)
        self._lyapunov = now
        if round_ >= 1 and round_ in {int(10 ** (e / 8)) for e in range(64)}:
            self.rounds.append(round_)
            self.norms.append(self._norms(stacked))

    def _xi(self, thetas: Floats) -> Floats:
        policies = softmax(thetas.reshape(-1, *SHAPE))
        values = self._own.values(policies).reshape(len(thetas), N).sum(axis=1)
        entropy = [relative_entropy(p) for p in policies.reshape(len(thetas), -1, SHAPE[1])]
        spread = [  # the penalty for disagreement
            np.einsum("id,ij,jd->", theta, np.eye(N) - W, theta) / (2 * alpha)
            for theta, W, alpha in zip(thetas, self._weights, self._steps, strict=True)
        ]
        # RE of all agents' states together is the mean of theirs: N of it is their sum.
        return np.asarray(-(values - LAMBDA * N * np.array(entropy)) + np.array(spread))

    def _norms(self, thetas: Floats) -> Floats:
        policies = softmax(thetas.reshape(len(thetas), N, *SHAPE))
        everywhere = np.tile(policies, (1, N, 1, 1)).reshape(-1, *SHAPE)  # task j, agent i
        _, gradients = self._pairs.gradients(everywhere, 0.0)
        means = gradients.reshape(len(thetas), N, N, -1).mean(axis=1)
        return np.asarray((means**2).sum(axis=2).max(axis=1))


def study(options: Options) -> Findings:
    """See the module's docstring."""
    rounds = 500 if options.quick else 20_000
    members = swarm_of("ring", 1.0, 1).members
    matrices = {
        kind: weight_matrix(graph(Topology(kind=kind), members), members) for kind in GRAPHS
    }
    spectra = {kind: spectrum(W) for kind, W in matrices.items()}
    cases = [(kind, times) for kind in GRAPHS for times in TIMES]
    steps = [0.999 * largest_step(spectra[kind]) * times for kind, times in cases]
    configs = [swarm_of(kind, step, rounds) for (kind, _), step in zip(cases, steps, strict=True)]
    models = random_worlds(np.random.default_rng(1), N, SHAPE, GAMMA, shared=False)
    probe = Probe(models, [matrices[kind] for kind, _ in cases], steps)

    def observe(round_: int, thetas: list[Vectors]) -> None:
        if round_ % 100 == 0:
            options.say(f"round {round_} of {rounds}, {len(cases)} swarms", round_ / rounds)
        probe(round_, thetas)

    simulate_together(configs, models=[models] * len(cases), observe=observe)
    best = np.minimum.accumulate(np.stack(probe.norms), axis=0)  # (K, C)
    at = np.array(probe.rounds, np.float64)
    claims: list[Claim] = []
    for c, ((kind, times), alpha) in enumerate(zip(cases, steps, strict=True)):
        where = f"{kind}, alpha {alpha:.2g} ({times} x)"
        weights, error = spectra[kind], probe.consensus[c]
        bound = gradient_bound(alpha, weights, at)
        worst = int((best[:, c] / bound).argmax())
        claims += [
            at_most(
                f"{where}: min grad^2 where nearest to its bound", best[worst, c], bound[worst]
            ),
            at_most(f"{where}: consensus error", error, consensus_bound(alpha, weights)),
        ]
        if times == 1:
            rise = probe.rises[c]
            claims.append(at_most(f"{where}: largest rise of Lyapunov", rise, ROUNDING, "<= 0"))
    slopes = [_slope(at * alpha, best[:, c]) for c, alpha in enumerate(steps)]
    fastest = [s for s, (_, times) in zip(slopes, cases, strict=True) if times == TIMES[-2]]
    if not options.quick:
        what = f"flattest log-log slope of min grad^2 over K, last decade, {TIMES[-2]} x"
        claims.append(bounded(what, max(fastest), high=-1.0, paper="-1 until the ball"))
    data: dict[str, Any] = {
        "rounds": probe.rounds,
        "cases": [
            {
                "graph": kind, "times": times, "alpha": alpha, "sigma_2": spectra[kind].second,
                "slope": slope, "consensus": error, "min_grad_squared": course,
            }
            for (kind, times), alpha, slope, error, course in zip(
                cases, steps, slopes, probe.consensus, best.T, strict=True
            )
        ],
    }  # fmt: skip
    return Findings(
        title=f"Theorem 1: {N} agents, exact gradients, {rounds} rounds",
        claims=claims,
        notes=[
            "Steps are multiples of the theorem's largest one; only 1 x is covered by it. "
            "Its bounds are loose by orders of magnitude and hold for the larger steps, too.",
            "Bound on min grad^2: the proof's constants, with 16 lambda^2 (print: over N) and "
            "the sum of 1 / (1 - gamma_j)^6 above the line (print: below it); notes, 6.",
        ],
        data=data,
        figures=[_draw(options, cases, steps, spectra, at, best, probe)],
    )


def _slope(x: Floats, y: Floats) -> float:
    """Of log y over log x in the last decade of x."""
    late = x >= x[-1] / 10
    return float(np.polyfit(np.log(x[late]), np.log(y[late]), 1)[0])


def _draw(
    options: Options,
    cases: list[tuple[Kind, int]],
    steps: list[float],
    spectra: dict[Kind, Spectrum],
    at: Floats,
    best: Floats,
    probe: Probe,
) -> Path:
    figure, axes = figures.canvas(3)
    for c, (kind, times) in enumerate(cases):
        if kind == "ring":
            axes[0, 0].loglog(at, best[:, c], color=figures.COLOURS[TIMES.index(times)],
                              label=f"α = {steps[c]:.2g} ({times} ×)")  # fmt: skip
        if times == TIMES[-1]:
            axes[0, 1].loglog(at, best[:, c], color=figures.COLOURS[GRAPHS.index(kind)],
                              label=f"{kind}, 1 − σ₂ = {spectra[kind].gap:.2g}")  # fmt: skip
    k = np.geomspace(at[-1] / 30, at[-1], 2)
    axes[0, 0].loglog(k, best[-1, cases.index(("ring", 100))] * k[-1] / k, "k:", label="∝ 1/K")
    y = "min ‖mean gradient‖², worst agent"
    figures.label(axes[0, 0], "Ring: larger steps are faster ...", "rounds K", y)
    figures.label(axes[0, 1], f"... until the ball (α {TIMES[-1]} ×)", "rounds K", y)
    for kind, colour in zip(GRAPHS, figures.COLOURS, strict=False):
        mine = [c for c, case in enumerate(cases) if case[0] == kind]
        alphas = np.array(steps)[mine]
        axes[0, 2].loglog(alphas, probe.consensus[mine], "o-", color=colour, label=kind)
        bound = [consensus_bound(alpha, spectra[kind]) for alpha in alphas]
        axes[0, 2].loglog(alphas, bound, "--", color=colour, linewidth=1)
    figures.label(axes[0, 2], "Consensus: measured —, bound - -", "step α", "largest ‖θᵢ − mean θ‖")
    for panel in axes[0]:
        panel.legend()
    return figures.save(figure, options.out / "theorem1.png")
