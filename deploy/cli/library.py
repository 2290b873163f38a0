"""``swarm library``: what comes with the package, to be started by name or copied and changed."""

import shutil
import sys
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from deploy.library import KINDS, POLICIES, Kind, about, entries, named
from swarm.errors import ConfigError

USES = {  # of a folder of the library
    "swarms": "swarm up NAME",
    "faults": "swarm up ... --chaos NAME",
    "policies": "swarm eval NAME",
}

app = typer.Typer(
    invoke_without_command=True,
    rich_markup_mode=None,
)

Name = Annotated[
    str, typer.Argument(metavar="NAME", help="As listed; with its ending where two have the name.")
]


@app.callback()
def show_all(
    context: typer.Context,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the swarm files, faults and policies by name.

    They come with the package, a line each; a name does wherever a file is expected.
    """
    if context.invoked_subcommand is not None:
        return
    listed = {
        kind.folder: {path.stem: _about(path, kind) for path in entries(kind)} for kind in KINDS
    }
    if json:
        print(msgspec.json.format(msgspec.json.encode(listed), indent=2).decode())
        return
    wide = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    longest = max(len(name) for names in listed.values() for name in names)
    for kind in KINDS:
        print(f"{kind.folder}  ({USES[kind.folder]})")
        for name, text in listed[kind.folder].items():
            line = f"  {name:<{longest}}  {text}"
            print(line if wide is None or len(line) <= wide else line[: wide - 3] + "...")


@app.command()
def show(name: Name) -> None:
    """Print a file, or what a policy says about itself."""
    from deploy.policies.header import header_of  # noqa: PLC0415

    for path in named(name):
        if path.suffix == POLICIES.suffix:
            header = header_of(path)
            print(f"# {path}", *(header.lines() if header else ()), sep="\n")
        else:
            print(f"# {path}", path.read_text(encoding="utf-8"), sep="\n", end="")


@app.command()
def copy(
    name: Name,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to.")] = Path(),
) -> None:
    """Copy a file here, to be changed.

    Raises:
        ConfigError: it is there already, or cannot be written.
    """
    for path in named(name):
        target = folder / path.name
        try:
            with target.open("xb") as file:
                file.write(path.read_bytes())
        except FileExistsError:
            raise ConfigError(f'"{target}" exists: expected another folder') from None
        except OSError as error:
            raise ConfigError(f'"{target}" cannot be written: {error.strerror}') from None
        print(target)


def _about(path: Path, kind: Kind) -> str:
    if kind is not POLICIES:
        return about(path)
    from deploy.policies.header import header_of  # noqa: PLC0415

    header = header_of(path)
    return header.title() if header else "says nothing about itself"
