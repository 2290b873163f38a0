"""The command line ``swarm``.

Each command is a page of arguments and a call; what it does stands in the room named after it.  A
user's mistake is one line on standard error and a non-zero exit code.
"""

import os
import shlex
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from agent.config.experiment import load
from agent.daemon.joining import fetch_config
from agent.daemon.process import run_agent
from agent.storage.runfolder import RunFolder
from agent.storage.runs import RUNS
from deploy.cli.drones import app as drones
from deploy.cli.policies import app as policies
from deploy.cli.reproduce import app as reproduce
from deploy.process.logs import log_to
from deploy.process.signals import stop_on_signals
from swarm.errors import ConfigError, SwarmError
from swarm.wire.keys import check_name

app = typer.Typer(
    help="A swarm of drones learns one policy for all of their worlds, peer to peer.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

app.add_typer(drones)
app.add_typer(policies)
app.add_typer(reproduce, name="reproduce")

File = Annotated[
    Path, typer.Argument(metavar="FILE", help="Swarm file (TOML).", show_default=False)
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the file; repeatable."),
]
Scenes = Annotated[
    list[str] | None,
    typer.Option(
        "--scene", metavar="NAME|FILE", help="World or mesh file; repeatable; default: all worlds."
    ),
]
Device = Annotated[
    str | None, typer.Option(metavar="cpu|cuda", help="Where networks compute (policy.device).")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@app.command()
def up(
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="Swarm file (TOML).", show_default=False)
    ] = None,
    settings: Settings = None,
    resume: Annotated[
        Path | None, typer.Option(metavar="RUN", help="Go on with this run folder instead.")
    ] = None,
    run: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Run folder; default runs/NAME-DATE.")
    ] = None,
    record: Annotated[bool, typer.Option(help="Write recording.rrd for Rerun.")] = True,
    chaos: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Faults to inject, see deploy/chaos.")
    ] = None,
    device: Device = None,
) -> None:
    """Start all agents of a swarm file as processes on this machine and wait for their result."""
    from deploy.chaos.faults import load_faults  # noqa: PLC0415
    from deploy.launch.preparation import prepare  # noqa: PLC0415
    from deploy.launch.preparation import resume as prepare_again  # noqa: PLC0415
    from deploy.launch.up import launch  # noqa: PLC0415

    if (file is None) == (resume is None):
        raise typer.BadParameter("expected either FILE or --resume RUN")
    settings = _on(device, settings)
    if resume is not None:
        with prepare_again(resume, settings) as prepared:
            faults = load_faults(chaos, prepared.config) if chaos else ()
            raise typer.Exit(launch(prepared, record, faults))
    assert file is not None
    config = load(file, settings)
    faults = load_faults(chaos, config) if chaos else ()
    with prepare(config, run) as prepared:
        raise typer.Exit(launch(prepared, record, faults))


@app.command()
def agent(
    id_: Annotated[str, typer.Option("--id", help="Which agent of the file.")],
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="Swarm file (TOML).", show_default=False)
    ] = None,
    join: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Instead of FILE: get it from this running swarm."),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT", help="With --join: ask there, not by multicast; repeatable."
        ),
    ] = None,
    settings: Settings = None,
    run: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Run folder; default runs/NAME.")
    ] = None,
    resume: Annotated[bool, typer.Option(help="Go on from the newest checkpoint, if any.")] = False,
    begin: Annotated[
        int | None, typer.Option(metavar="ROUND", help="With --resume: from this checkpoint.")
    ] = None,
    supervised: Annotated[
        bool, typer.Option(help="Log to the run folder only; end when standard input closes.")
    ] = False,
    metrics: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Serve /metrics for Prometheus, and /healthz."),
    ] = None,
    json_logs: Annotated[bool, typer.Option("--json-logs", help="Log JSON lines.")] = False,
    device: Device = None,
) -> None:
    """Run one agent, as a drone would; SIGTERM or Ctrl-C ends it with a checkpoint."""
    if (file is None) == (join is None):
        raise typer.BadParameter("expected either FILE or --join NAME")
    if connect and join is None:
        raise typer.BadParameter("--connect goes with --join: FILE has its endpoints")
    settings = _on(device, settings)
    config = load(file, settings) if file is not None else None
    if config is not None:
        config.index(id_)
    name = config.name if config is not None else check_name("--join", join or "")
    folder = RunFolder(run or RUNS / name)
    stop = stop_on_signals()
    folder.prepare(id_)
    log_to(folder.log(id_), id_, quiet=supervised, as_json=json_logs)
    if config is None:
        config = fetch_config(name, id_, connect or (), settings)
        folder.write_config(config)
    if supervised:
        threading.Thread(target=_stop_at_end_of_input, args=(stop,), daemon=True).start()
    run_agent(config, id_, folder, stop, resume, begin, metrics)


@app.command()
def status(
    target: Annotated[
        Path | None,
        typer.Argument(metavar="FILE|RUN", help="Swarm file or run folder; default: the newest."),
    ] = None,
    settings: Settings = None,
    json: AsJson = False,
    timeout: Annotated[float, typer.Option(help="How long to look for agents [s].")] = 2.0,
    watch: Annotated[
        bool, typer.Option("--watch", help="Look again and again, to Ctrl-C.")
    ] = False,
) -> None:
    """Show the agents of a running swarm.  Exit code: 0 healthy, 1 degraded, 3 nobody."""
    from deploy.observe.status import find_config, show_status, watch_status  # noqa: PLC0415

    if watch and json:
        raise typer.BadParameter("expected either --json or --watch")
    found = find_config(target, settings or ())
    raise typer.Exit(watch_status(found, timeout) if watch else show_status(found, json, timeout))


@app.command()
def compose(
    file: File,
    settings: Settings = None,
    context: Annotated[
        str, typer.Option(metavar="DIR", help="This repository, from the compose file's folder.")
    ] = ".",
) -> None:
    """Print a Docker Compose file for a swarm file: an agent and a vehicle each, and a viewer."""
    from deploy.images.compose import compose_file  # noqa: PLC0415

    source = shlex.join([str(file), *(word for s in settings or () for word in ("--set", s))])
    print(compose_file(load(file, settings or ()), source, context), end="")


@app.command()
def topology(file: File, settings: Settings = None, json: AsJson = False) -> None:
    """Show the graph of a swarm file: edges, weights W, eigenvalues, spectral gap."""
    from deploy.observe.topology import show_topology  # noqa: PLC0415

    show_topology(load(file, settings or ()), json)


@app.command()
def view(
    target: Annotated[
        Path | None,
        typer.Argument(metavar="FILE|RUN", help="Swarm file or run folder; default: the newest."),
    ] = None,
    settings: Settings = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.rrd", help="Write a recording, show nothing.")
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Serve the viewer to browsers.")] = False,
    host: Annotated[
        str, typer.Option(help="With --web: name by which browsers reach this machine.")
    ] = "localhost",
    ports: Annotated[
        tuple[int, int], typer.Option(help="With --web: of the page, and of the data.")
    ] = (9090, 9876),
    screenshot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Write a picture at the end.")
    ] = None,
    headless: Annotated[
        bool, typer.Option("--headless", help="With --screenshot: open no window.")
    ] = False,
    seconds: Annotated[
        float | None, typer.Option(help="Watch for so long, there or not [s].")
    ] = None,
    live: Annotated[
        bool | None,
        typer.Option(help="Attach to the running swarm, or show what the folder holds; "
                          "default: live if anybody answers."),
    ] = None,
) -> None:  # fmt: skip
    """Show a swarm in Rerun: live, attached at any time, or from a run folder."""
    try:
        from deploy.viewer import Output  # noqa: PLC0415
        from deploy.viewer import view as show  # noqa: PLC0415
    except ImportError:
        raise SwarmError(
            'the viewer needs rerun-sdk, which is not installed: pip install "dcpg-swarm[viewer]"'
        ) from None
    from deploy.observe.status import find_config  # noqa: PLC0415

    found = find_config(target, settings or ())
    show(found, Output(save, web, host, ports, headless, screenshot, seconds), live)


@app.command()
def doctor(
    target: Annotated[
        Path | None,
        typer.Argument(metavar="FILE|RUN", help="Swarm file or run folder; default: the newest."),
    ] = None,
    settings: Settings = None,
    id_: Annotated[
        str | None, typer.Option("--id", help="Look as this agent, from its machine.")
    ] = None,
    json: AsJson = False,
    timeout: Annotated[float, typer.Option(help="Longest single wait [s].")] = 2.0,
) -> None:
    """Say why an agent sees nobody, and what to change.  Exit code: 0 all is well, 1 it is not."""
    from deploy.diagnose.doctor import diagnose, show  # noqa: PLC0415

    raise typer.Exit(show(diagnose(target, settings or (), id_, timeout), json))


@app.command()
def certs(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where the certificates are kept.")],
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="Swarm file: its agents and their hosts.")
    ] = None,
    settings: Settings = None,
    agents: Annotated[
        str, typer.Option(metavar="ID,ID,...", help="Agents, instead of or beside those of FILE.")
    ] = "",
    host: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[ID=]HOST", help="Name or address of an agent, or of all; repeatable."
        ),
    ] = None,
    days: Annotated[int, typer.Option(min=1, help="How long certificates are valid.")] = 365,
    force: Annotated[
        bool, typer.Option("--force", help="Renew certificates that are there.")
    ] = False,
) -> None:
    """Make an authority and a certificate for each agent and for observers, for [network.security].

    Running it again adds what is missing and leaves the rest alone.
    """
    try:
        from deploy.images.certs import hosts_of, make_certificates, tell  # noqa: PLC0415
    except ImportError:
        raise SwarmError(
            "certificates need the package cryptography, which is not installed: "
            'pip install "dcpg-swarm[security]"'
        ) from None

    # Of the file only ids and hosts count: it may name certificates that are still to be made.
    config = load(file, settings or ()) if file else None
    tell(folder, make_certificates(folder, hosts_of(config, agents, host or ()), days, force))


@app.command()
def worlds(
    scenes: Scenes = None,
    sheet: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Write a contact sheet.")
    ] = None,
    width: Annotated[int | None, typer.Option(min=100, help="Of the sheet [pixels].")] = None,
) -> None:
    """Show the indoor worlds: a table, and with --sheet their plans and views as a picture."""
    from deploy.flying.sheet import worlds as show  # noqa: PLC0415
    from sim.indoor.content.scenes import NAMES  # noqa: PLC0415

    with _plain_errors():
        show(scenes or NAMES, sheet, width)


@contextmanager
def _plain_errors() -> Iterator[None]:
    """The worlds raise the standard library's exceptions; a user sees their one line."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise SwarmError(
            f'this needs {error.name}, which is not installed: pip install "dcpg-swarm[figures]"'
        ) from None
    except (ValueError, OSError) as error:
        raise ConfigError(str(error)) from None


def _on(device: str | None, settings: list[str] | None) -> list[str]:
    """The settings, with ``--device`` as one of them."""
    return [*(settings or ()), *([f'policy.device="{device}"'] if device else [])]


def _stop_at_end_of_input(stop: threading.Event) -> None:
    """Set ``stop`` when whoever started us is gone."""
    while os.read(0, 4096):  # not sys.stdin: its lock would be held at interpreter shutdown
        pass
    stop.set()


def main() -> None:
    """Entry point of the ``swarm`` command."""
    try:
        app()
    except SwarmError as error:
        print(f"swarm: {error}", file=sys.stderr)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
