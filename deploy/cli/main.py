"""The command line ``swarm``.

Each command is a page of arguments and a call, in the file of its group; what it does stands in the
room named after it.  A user's mistake is one line on standard error and a non-zero exit code
(:mod:`deploy.cli.mistakes`).
"""

import sys
from importlib import metadata
from typing import Annotated

import typer

from deploy.cli import drones, images, launch, library, observe, policies, reproduce
from deploy.cli.mistakes import one_line

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None)
for group in (launch, observe, policies, drones, images):
    app.add_typer(group.app)
app.add_typer(library.app, name="library")
app.add_typer(reproduce.app, name="reproduce")


def _version(wanted: bool) -> None:
    if wanted:
        print(f"swarm {metadata.version('dcpg-swarm')}")
        raise typer.Exit


@app.callback()
def overview(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=_version, is_eager=True),
    ] = False,
) -> None:
    """A swarm of drones learns one policy for all of their worlds, peer to peer."""


def main() -> None:
    """Run the command that the arguments name; see :mod:`deploy.cli.__main__`."""
    with one_line():
        sys.exit(app(prog_name="swarm", standalone_mode=False))
