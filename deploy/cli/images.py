"""The commands that prepare other machines: ``swarm compose`` and ``swarm certs``."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from agent.config.experiment import load
from deploy.cli.options import File, MaybeFile, Settings

app = typer.Typer()


@app.command()
def compose(
    file: File,
    settings: Settings = None,
    context: Annotated[
        str, typer.Option(metavar="DIR", help="This repository, from the compose file's folder.")
    ] = ".",
) -> None:
    """Print a Docker Compose file for a swarm file.

    A container for each agent, for the vehicle that its task flies, and for a viewer.
    """
    from deploy.images.compose import compose_file  # noqa: PLC0415

    source = shlex.join([str(file), *(word for s in settings or () for word in ("--set", s))])
    print(compose_file(load(file, settings or ()), source, context), end="")


@app.command()
def certs(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where the certificates are kept.")],
    file: MaybeFile = None,
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
    """Make the certificates that [network.security] names.

    An authority, and a certificate for each agent of FILE (or --agents) and for observers.

    Running it again adds what is missing and leaves the rest alone.
    """
    from deploy.images.certs import hosts_of, make_certificates, tell  # noqa: PLC0415

    # Of the file only ids and hosts count: it may name certificates that are still to be made.
    config = load(file, settings or ()) if file else None
    tell(folder, make_certificates(folder, hosts_of(config, agents, host or ()), days, force))
