"""The commands that look: ``swarm status``, ``topology``, ``view`` and ``doctor``."""

from pathlib import Path
from typing import Annotated

import typer

from agent.config.experiment import load
from deploy.cli.options import AsJson, File, Settings, Target

app = typer.Typer()


@app.command()
def status(
    target: Target = None,
    settings: Settings = None,
    json: AsJson = False,
    timeout: Annotated[
        float, typer.Option(min=0.01, max=3600, help="How long to look for agents [s].")
    ] = 2.0,
    watch: Annotated[
        bool, typer.Option("--watch", help="Look again and again, to Ctrl-C.")
    ] = False,
) -> None:
    """Show the agents of a running swarm, or how a run ended.

    Exit code: 0 healthy or finished, 1 degraded or ended otherwise, 3 nobody answers.
    """
    from deploy.observe.status import find_config, show_status, watch_status  # noqa: PLC0415

    if watch and json:
        raise typer.BadParameter("expected either --json or --watch")
    found = find_config(target, settings or ())
    raise typer.Exit(watch_status(found, timeout) if watch else show_status(found, json, timeout))


@app.command()
def topology(file: File, settings: Settings = None, json: AsJson = False) -> None:
    """Show the graph of a swarm file.

    Its edges, weights W, eigenvalues and spectral gap.
    """
    from deploy.observe.topology import show_topology  # noqa: PLC0415

    show_topology(load(file, settings or ()), json)


@app.command()
def view(
    target: Target = None,
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
        float | None, typer.Option(min=0, max=1e6, help="Watch for so long, there or not [s].")
    ] = None,
    live: Annotated[
        bool | None,
        typer.Option(help="Attach to the running swarm, or show what the folder holds; "
                          "default: live if anybody answers."),
    ] = None,
) -> None:  # fmt: skip
    """Show a swarm in Rerun, live or from a run folder.

    A viewer may be attached at any time.
    """
    from deploy.observe.status import find_config  # noqa: PLC0415
    from deploy.viewer import Output  # noqa: PLC0415
    from deploy.viewer import view as show  # noqa: PLC0415

    found = find_config(target, settings or ())
    show(found, Output(save, web, host, ports, headless, screenshot, seconds), live)


@app.command()
def doctor(
    target: Target = None,
    settings: Settings = None,
    id_: Annotated[
        str | None, typer.Option("--id", help="Look as this agent, from its machine.")
    ] = None,
    json: AsJson = False,
    timeout: Annotated[
        float, typer.Option(min=0.01, max=3600, help="Longest single wait [s].")
    ] = 2.0,
) -> None:
    """Say why an agent sees nobody, and what to change.

    Exit code: 0 all is well, 1 it is not.
    """
    from deploy.diagnose.doctor import diagnose, show  # noqa: PLC0415
    from deploy.process.news import working  # noqa: PLC0415

    with working("looking at the swarm"):
        diagnosis = diagnose(target, settings or (), id_, timeout)
    raise typer.Exit(show(diagnosis, json))
