"""Sec. 2.2 of the paper: what is hard about several tasks, on its chain of five states.

1.  Example 1: the best policy takes left and right in S3 with probability 1/2.
2.  Example 2: two pure policies and the even one are stationary; the even one is the worst of all.
3.  The trap (not in the paper): plain DCPG with two agents *converges* to the worst policy when its
    step is larger than a critical one.  Each agent leans towards its own task by an amount that
    grows with the step; between two agents that lean apart the worst policy is stable.
"""

from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from agent.config.experiment import AgentEntry, SwarmFile, Task
from agent.learning.estimators import Exact
from agent.learning.optimizers import Sgd
from agent.learning.policies import Tabular
from deploy.reproduce import figures
from deploy.reproduce.claims import Claim, Findings, Options, bounded, close
from deploy.simulate.simulator import Vectors, simulate_together
from sim.tabular.chain import LEFT, S3, chain_model
from sim.tabular.mdp import FiniteMDP, Floats
from swarm.mixing.rules import Mixing, RuleName

ROOT_HALF = float(np.sqrt(0.5))  # the gamma for which the paper prints numbers
GAMMAS = (0.5, ROOT_HALF, 0.9, 0.99)
TRAP = {"p": 0.75, "gamma": 0.9}
TILT = 0.1  # theta[S3, left] - theta[S3, right] at the start of the runs


def chance_of_left(x: float, elsewhere: tuple[float, float]) -> Floats:
    """The policy (5, 2) that goes left in S3 with probability x."""
    policy = np.tile(elsewhere, (5, 1))
    policy[S3] = (x, 1 - x)
    return policy


def value(models: list[FiniteMDP], x: float, elsewhere: tuple[float, float] = (0.5, 0.5)) -> float:
    """V_1 + V_2 of it."""
    return sum(model.value(chance_of_left(x, elsewhere)) for model in models)


def slope(models: list[FiniteMDP], x: float) -> float:
    """d (V_1 + V_2) / dx, from exact advantages (policy gradient theorem), for any x."""
    policy = chance_of_left(x, (0.5, 0.5))
    total = 0.0
    for model in models:
        visits = model.visitation(policy)[S3] / (1 - model.gamma)
        q = model.action_values(policy)[S3]
        total += visits * (q[LEFT] - q[1 - LEFT])
    return float(total)


def maximise(f: Callable[[float], float], steps: int = 100) -> float:
    """Where a function with one peak on [0, 1] is largest: ternary search."""
    low, high = 0.0, 1.0
    for _ in range(steps):
        a, b = low + (high - low) / 3, high - (high - low) / 3
        low, high = (a, high) if f(a) < f(b) else (low, b)
    return (low + high) / 2


def both(*, modified: bool, p: float = 0.75, gamma: float) -> list[FiniteMDP]:
    """The two tasks."""
    return [chain_model(task, modified=modified, p=p, gamma=gamma) for task in (1, 2)]


def pure_value(p: float, gamma: float) -> float:
    """V of always left (or always right) in example 2, from the appendix, any p and gamma."""
    g2 = gamma * gamma
    return gamma * (-2 * g2 * p + g2 + 2 * p - 1) / (g2 * g2 * (p * p - p) + g2 - 1)


def even_value(p: float, gamma: float) -> float:
    """V of left or right with probability 1/2."""
    return gamma * (2 - 4 * p) / (2 - gamma * gamma)


def critical_step(p: float, gamma: float) -> float:
    """The step above which two agents of plain DCPG converge to the worst policy (notes)."""
    c, b = 1 - gamma**2 * (1 - p), 1 - gamma**2 * p
    return float(2 * np.log(c / b) * c * b / (gamma * (1 - gamma**2 * (p * p + (1 - p) ** 2))))


def trap_swarm(rule: RuleName, step: float, rounds: int, p: float, gamma: float) -> SwarmFile:
    """Two agents, exact gradients, example 2."""
    return SwarmFile(
        name="trap",
        agents=tuple(
            AgentEntry(f"task{t}", Task("sim:Chain-v0", {"task": t, "modified": True, "p": p}))
            for t in (1, 2)
        ),
        estimator=Exact(gamma=gamma, entropy_weight=0.0),
        policy=Tabular(precision="float64"),
        optimizer=Sgd(step=step),
        mixing=Mixing(rule=rule),
        rounds=rounds,
    )


def study(options: Options) -> Findings:
    """See the module's docstring."""
    claims = [*_example1(options), *_example2()]
    trap, courses = _trap(options)
    claims += trap
    file = _draw(options, courses)
    return Findings(
        title="Examples 1 and 2 of the paper (Sec. 2.2), and the trap",
        claims=claims,
        notes=[
            "The paper's numbers at gamma = sqrt(1/2) are misprinted (notes, 7); "
            "its ordering of the values stands.",
            f"The runs of the trap start at theta(S3, left) - theta(S3, right) = {TILT} for both "
            "agents, and all rules use the same step. ATC escapes because W of two agents averages "
            "exactly: after its exchange the agents no longer lean apart.",
        ],
        data={
            "critical_step": critical_step(**TRAP),
            "trap": TRAP,
            "chance_of_left_every_20_rounds": {n: course[::20] for n, course in courses.items()},
        },
        figures=[file],
    )


def _example1(options: Options) -> list[Claim]:
    claims, left = [], (1.0, 0.0)
    for gamma in GAMMAS:
        models = both(modified=False, gamma=gamma)
        formula = 2 * gamma / (2 - gamma**2)
        best = maximise(lambda x, m=models: value(m, x, left))  # type: ignore[misc]
        at = f"gamma {gamma:.4g}"
        claims += [
            close(f"example 1, {at}: best chance of left in S3", 0.5, 0.5, best, 1e-6),
            close(f"example 1, {at}: its value", formula, formula, value(models, best, left), 1e-9),
            close(
                f"example 1, {at}: value of always left", gamma, gamma, value(models, 1, left), 1e-9
            ),
        ]
    config = trap_swarm("dcpg", 1.0, 500 if options.quick else 4000, 0.75, 0.9)
    tasks = [
        msgspec.structs.replace(a, task=Task("sim:Chain-v0", {"task": t}))
        for t, a in enumerate(config.agents, 1)
    ]
    start = np.zeros((2, 10))
    start[:, 2 * S3] = 1.0
    config = msgspec.structs.replace(config, agents=tuple(tasks))
    theta = simulate_together([config], initial=[start])[0].thetas.mean(axis=0).reshape(5, 2)
    learned = float(1 / (1 + np.exp(theta[S3, 1] - theta[S3, 0])))
    claims.append(
        close(
            "example 1, gamma 0.9: what two agents learn from chance 0.73", 0.5, 0.5, learned, 1e-2
        )
    )
    return claims


def _example2() -> list[Claim]:
    claims = []
    for p in (0.6, 0.75, 0.9):
        models, at = both(modified=True, p=p, gamma=ROOT_HALF), f"example 2, p {p}"
        pure = np.sqrt(2) * (2 * p - 1) / ((p - 2) * (p + 1))
        even = 2 * np.sqrt(2) * (1 - 2 * p) / 3
        printed = (2 * p - 1) / (8 * np.sqrt(2) * (p - 2) * (p + 1)), (4 - 8 * p) / 3
        claims += [
            close(f"{at}: value of always left", printed[0], pure, value(models, 1), 1e-9),
            close(f"{at}: value of always right", printed[0], pure, value(models, 0), 1e-9),
            close(f"{at}: value of 1/2", printed[1], even, value(models, 0.5), 1e-9),
        ]
    ps, worst = np.linspace(0.51, 1, 15), np.zeros(3)
    shape = True
    for gamma in GAMMAS:
        for p in ps:
            models = both(modified=True, p=p, gamma=gamma)
            errors = (
                value(models, 1) - pure_value(p, gamma),
                value(models, 0.5) - even_value(p, gamma),
                slope(models, 0.5),
            )
            worst = np.maximum(worst, np.abs(errors))
            # Falls to the middle, rises after it: 1/2 is the only minimum, both ends are maxima.
            slopes = [slope(models, x) for x in (0.0, 0.2, 0.4, 0.499, 0.501, 0.6, 0.8, 1.0)]
            shape &= all(s < 0 for s in slopes[:4]) and all(s > 0 for s in slopes[4:])
    over = f"{ps.size} p in (1/2, 1], {len(GAMMAS)} gamma"
    claims += [
        close(f"general formula, pure policies: largest error, {over}", "", 0, worst[0], 1e-9),
        close(f"general formula, even policy: largest error, {over}", "", 0, worst[1], 1e-9),
        close(f"slope of the value at 1/2: largest, {over}", 0.0, 0, worst[2], 1e-9),
        Claim(
            f"nature of the stationary points, {over}",
            "pure: global maxima; even: not optimal",
            "pure: global maxima; even: global minimum",
            "as corrected" if shape else "otherwise",
            bool(shape),
        ),
    ]
    return claims


def _trap(options: Options) -> tuple[list[Claim], dict[str, list[float]]]:
    critical = critical_step(**TRAP)
    rounds = 400 if options.quick else 1500
    configs = [trap_swarm("dcpg", 0.9 * critical, rounds, **TRAP)]
    rules: list[RuleName] = ["dcpg", "atc", "exact-diffusion", "extra", "gradient-tracking"]
    configs += [trap_swarm(rule, 1.1 * critical, rounds, **TRAP) for rule in rules]
    names = ["dcpg at 0.9", *(f"{rule} at 1.1" for rule in rules)]
    start = np.zeros((2, 10))
    start[:, 2 * S3] = TILT
    courses: dict[str, list[float]] = {name: [] for name in names}

    def observe(round_: int, thetas: list[Vectors]) -> None:
        for name, theta in zip(names, thetas, strict=True):
            lean = theta.mean(axis=0)[2 * S3 : 2 * S3 + 2]
            courses[name].append(float(1 / (1 + np.exp(lean[1] - lean[0]))))

    options.say("the trap")
    simulate_together(configs, initial=[start] * len(configs), observe=observe)
    models = both(modified=True, **TRAP)
    worst, best = value(models, 0.5), value(models, 1.0)
    claims = [
        close(
            "trap: critical step, from our own stability analysis", "", critical, _stability(), 1e-6
        )
    ]
    for name, course in courses.items():
        left, reached = course[-1], value(models, course[-1])
        trapped = name == "dcpg at 1.1"
        share = (reached - worst) / (best - worst)
        claims.append(
            bounded(
                f"trap, {name} critical steps: from worst value (0) to best (1), left {left:.3f}",
                share,
                None if trapped else 0.9,
                0.01 if trapped else None,
            )
        )
    return claims, courses


def _stability() -> float:
    """The step at which the symmetric fixed point of two agents turns stable, found by bisection.

    With u_i = theta_i(left) - theta_i(right) in S3, a round is u_i' = mean(u) + step h_i(u_i) for
    h_i = 2 dV_i / dtheta_left.  A fixed point with mean 0 has u_1 = -u_2 = u = step h_1(u); the
    mean then moves by the factor 1 + step h_1'(u).
    """
    first, _ = both(modified=True, **TRAP)

    def pull(u: float) -> float:
        x = 1 / (1 + np.exp(-u))
        return float(2 * first.gradient(chance_of_left(x, (0.5, 0.5)), 0.0)[S3, LEFT])

    def excess(step: float) -> float:
        u = 0.0
        for _ in range(200):  # a contraction: h is bounded and flat far out
            u = 0.5 * u + 0.5 * step * pull(u)
        return pull(u + 1e-5) - pull(u - 1e-5)

    low, high = 1e-3, 100.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return (low + high) / 2


def _draw(options: Options, courses: dict[str, list[float]]) -> Path:
    figure, axes = figures.canvas(3)
    xs = np.linspace(0, 1, 101)
    for colour, gamma in zip(figures.COLOURS, GAMMAS, strict=False):
        models = both(modified=False, gamma=gamma)
        ys = [value(models, x, (1.0, 0.0)) for x in xs]
        axes[0, 0].plot(xs, ys, color=colour, label=f"γ = {gamma:.3g}")
        axes[0, 0].plot(0.5, 2 * gamma / (2 - gamma**2), "o", color=colour)
    figures.label(axes[0, 0], "Example 1: the best policy is even", "π(left | S3)", "V₁ + V₂")
    axes[0, 0].legend()
    for colour, p in zip(figures.COLOURS, (0.6, 0.75, 0.9), strict=False):
        models = both(modified=True, p=p, gamma=ROOT_HALF)
        ys = [value(models, x) for x in xs]
        axes[0, 1].plot(xs, ys, color=colour, label=f"p = {p}")
        axes[0, 1].plot([0, 1], [pure_value(p, ROOT_HALF)] * 2, "^", color=colour)
        axes[0, 1].plot(0.5, even_value(p, ROOT_HALF), "v", color=colour)
    figures.label(
        axes[0, 1], "Example 2: the even policy is the worst", "π(left | S3)", "V₁ + V₂ (γ = √½)"
    )
    axes[0, 1].set_ylim(top=0.12)
    axes[0, 1].legend(loc="upper center", ncols=3)
    styles = ["-", "-", "--", "-", "--", ":"]
    colours = [
        figures.BLUE,
        figures.RED,
        figures.ORANGE,
        figures.GREEN,
        figures.BLACK,
        figures.PINK,
    ]
    for (name, course), style, colour in zip(courses.items(), styles, colours, strict=True):
        axes[0, 2].plot(range(1, len(course) + 1), course, style, color=colour, label=name)
    axes[0, 2].set_xscale("log")
    figures.label(
        axes[0, 2], "Two agents, steps of 0.9 and 1.1 critical ones", "round", "π(left | S3), mean"
    )
    axes[0, 2].legend(loc="upper left", fontsize=7)
    return figures.save(figure, options.out / "examples.png")
