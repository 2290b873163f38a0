"""``swarm reproduce``: one command a study."""

import os
from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from agent.storage.runs import RUNS, check_own_folder
from deploy.process.news import working
from deploy.process.packages import needs
from deploy.process.signals import StoppedError, stopping_at_signals
from deploy.reproduce.claims import Findings, Options, Study, publish
from swarm.errors import SwarmError

app = typer.Typer(
    help="Print the paper again, and what lies beyond it.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

SEEDS = 20
RESULTS = RUNS / "reproduce"
STUDIES = {  # name -> module with a function `study`, and what it is about
    "examples": "The two-task chain: no deterministic optimum, three stationary points, the trap.",
    "theorem1": "Convergence to a stationary point; consensus bound; Lyapunov function.",
    "theorem2": "Shared transitions: convergence to the global optimum.",
    "gridworld": "Grid worlds (a) to (e), single agents, the picture of Fig. 2.",
    "rules": "Mixing rules on a ring of 64 agents, and 1024 agents.",
    "faults": "Message loss by mixing rule and policy; delay; partition.",
    "poison": "One of six agents sends poison: plain mixing, clipping, trimmed mean.",
    "compression": "Halves and bytes on the wire instead of float32.",
    "learning": "Start-state mixing repairs (d); A2C and PPO.",
    "verify": "The simulator against real processes over Zenoh, bit for bit.",
}

Seeds = Annotated[int, typer.Option(min=1, help="Independent repetitions.")]
Quick = Annotated[bool, typer.Option("--quick", help="Shorter and coarser: a minute for all.")]
Out = Annotated[Path, typer.Option(metavar="DIR", help="Where to write; one folder a study.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def run_studies(names: Iterable[str], seeds: int, quick: bool, out: Path, as_json: bool) -> None:
    """Run studies one after the other; exit code 1 if a claim does not hold.

    Raises:
        SwarmError: matplotlib is missing.
        ConfigError: nothing can be written there.
    """
    _need_figures()
    check_own_folder("--out", out)
    console, good, names = _console(), True, tuple(names)
    for k, name in enumerate(names, 1):
        study: Study = import_module(f"deploy.reproduce.{name}").study
        label = name if len(names) == 1 else f"{name}, study {k} of {len(names)}"
        with working(label) as news, stopping_at_signals():
            options = Options(out / name, seeds, quick, news.say)
            good &= publish(name, study, options, as_json, console)
    raise typer.Exit(0 if good else 1)


def _need_figures() -> None:
    if find_spec("matplotlib") is None:
        raise SwarmError(needs("matplotlib", "a study") or "matplotlib is not installed")


def _console() -> Console:
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 120
    return console


def _command(name: str, about: str) -> None:
    @app.command(name, help=about, short_help=about)
    def command(
        seeds: Seeds = SEEDS, quick: Quick = False, out: Out = RESULTS, json: AsJson = False
    ) -> None:
        run_studies([name], seeds, quick, out, json)


for _name, _about in STUDIES.items():
    _command(_name, _about)


@app.command()
def drones(
    estimator: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="reinforce, a2c or ppo; repeatable; default: all."),
    ] = None,
    budget: Annotated[
        int, typer.Option(min=1, help="Steps of every drone; 4000 episodes of 150 by default.")
    ] = 600_000,
    seeds: Annotated[int, typer.Option(min=1, help="Repetitions of all, seeds 1, 2, ...")] = 1,
    flights: Annotated[int, typer.Option(min=1, help="Per policy, world and mode.")] = 100,
    jobs: Annotated[
        int, typer.Option(min=0, help="Agents that learn at a time; 0: one per core.")
    ] = 0,
    runs: Annotated[
        Path, typer.Option(metavar="DIR", help="Where the runs live; what is there goes on.")
    ] = RUNS / "drones",
    beside: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="A drones.json of this command, from elsewhere: what it has is not run again.",
        ),
    ] = None,
    out: Out = RESULTS,
    json: AsJson = False,
) -> None:
    """The drone experiment: Table 1 and Fig. 3; hours.

    Stopped, it goes on where it was.
    """
    from deploy.reproduce.drones.record import Record, read  # noqa: PLC0415
    from deploy.reproduce.drones.runs import ESTIMATORS  # noqa: PLC0415
    from deploy.reproduce.drones.table import study  # noqa: PLC0415

    for name in estimator or ():
        if name not in ESTIMATORS:
            raise typer.BadParameter(f'"{name}": expected one of {", ".join(ESTIMATORS)}')
    _need_figures()
    kept: dict[str, Record] = {}
    for file in beside or ():
        for name, record in read(file).items():
            if name in kept or name in (estimator or ()) or name not in ESTIMATORS:
                raise SwarmError(f'{file}: "{name}": expected what is not given otherwise')
            kept[name] = record
    wanted = estimator or [name for name in ESTIMATORS if name not in kept]
    chosen = [name for name in ESTIMATORS if name in wanted]
    console = _console()
    with working("drones") as news:
        options = Options(out / "drones", seeds, False, news.say)

        def whole(options: Options) -> Findings:
            workers = jobs or os.cpu_count() or 1
            return study(options, chosen, budget, flights, workers, runs, news.line, kept)

        try:
            with stopping_at_signals():
                good = publish("drones", whole, options, json, console)
        except StoppedError:
            news.line("stopped; the same command goes on where it was")
            raise typer.Exit(130) from None
    raise typer.Exit(0 if good else 1)


@app.command()
def network(
    agents: Annotated[int, typer.Option(min=4, max=8, help="Processes, each on its own host.")] = 4,
    fault: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="One of the library's faults; repeatable; default: all."),
    ] = None,
    quick: Quick = False,
    out: Out = RESULTS,
    json: AsJson = False,
) -> None:
    """What every fault costs a swarm of real processes.

    Every agent in a network namespace of its own; needs root.
    """
    from deploy.reproduce.network import FAULTS, study  # noqa: PLC0415

    for name in fault or ():
        if name not in FAULTS:
            raise typer.BadParameter(f'"{name}": expected one of {", ".join(FAULTS)}')
    _need_figures()
    chosen = tuple(name for name in FAULTS if name in (fault or FAULTS))
    console = _console()
    try:
        with working("network") as news, stopping_at_signals():
            options = Options(out / "network", 1, quick, news.say)
            good = publish("network", lambda o: study(o, agents, chosen), options, json, console)
    except StoppedError:
        raise typer.Exit(130) from None
    raise typer.Exit(0 if good else 1)


@app.command("all")
def run_all(
    seeds: Seeds = SEEDS, quick: Quick = False, out: Out = RESULTS, json: AsJson = False
) -> None:
    """All of them."""
    run_studies(STUDIES, seeds, quick, out, json)
