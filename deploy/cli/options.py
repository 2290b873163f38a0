"""Arguments and options that several commands share, each written once."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from agent.config.experiment import load
from agent.learning.policies import Tabular
from deploy.library import FAULTS, POLICIES, SWARMS, find
from swarm.errors import ConfigError

DEVICES = ("cpu", "cuda")


def swarm_file(path: Path | None) -> Path | None:
    """The swarm file that is meant: a path, or a name in the library."""
    return path and find(path, SWARMS)


def chaos_file(path: Path | None) -> Path | None:
    """The chaos file that is meant."""
    return path and find(path, FAULTS)


def policy(path: Path | None) -> Path | None:
    """The run folder or policy that is meant."""
    return path and find(path, POLICIES)


_FILE = typer.Argument(
    metavar="FILE",
    help="Swarm file (TOML), or a name in the library.",
    show_default=False,
    callback=swarm_file,
)
_POLICY = typer.Argument(
    metavar="RUN|FILE",
    help="Run folder, exported policy, or a name in the library.",
    show_default=False,
    callback=policy,
)
File = Annotated[Path, _FILE]
MaybeFile = Annotated[Path | None, _FILE]
Target = Annotated[
    Path | None,
    typer.Argument(
        metavar="FILE|RUN",
        help="Swarm file, a name in the library, or run folder; default: the newest run.",
        callback=swarm_file,
    ),
]
Chaos = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help='Faults to inject: a chaos file, or a name in the library ("swarm library").',
        callback=chaos_file,
    ),
]
Policy = Annotated[Path, _POLICY]
MaybePolicy = Annotated[Path | None, _POLICY]
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
OneAgent = Annotated[
    str | None,
    typer.Option(metavar="ID", help="RUN: one agent's parameters, not the mean of all."),
]
Seed = Annotated[int, typer.Option(min=0, help="Of all randomness.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def on(device: str | None, settings: Iterable[str] | None, file: Path | None) -> list[str]:
    """The settings, with ``--device`` as one of them.

    Args:
        device: where networks compute; None: as the file says.
        settings: of ``--set``.
        file: whose policy is to be one, where it is known.

    Raises:
        ConfigError: there is no such device, or what is learned is a table.
    """
    given = list(settings or ())
    if device is None:
        return given
    if device not in DEVICES:
        raise ConfigError(f'--device "{device}": expected {" or ".join(DEVICES)}')
    if file is not None and isinstance(load(file, given).policy, Tabular):
        raise ConfigError(
            f'--device {device}: policy.kind = "tabular" needs none; expected it for a network'
        )
    return [*given, f'policy.device="{device}"']
