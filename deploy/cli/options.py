"""Arguments and options that several commands share, each written once."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

File = Annotated[
    Path, typer.Argument(metavar="FILE", help="Swarm file (TOML).", show_default=False)
]
MaybeFile = Annotated[
    Path | None, typer.Argument(metavar="FILE", help="Swarm file (TOML).", show_default=False)
]
Target = Annotated[
    Path | None,
    typer.Argument(metavar="FILE|RUN", help="Swarm file or run folder; default: the newest."),
]
Policy = Annotated[
    Path,
    typer.Argument(metavar="RUN|FILE", help="Run folder, or exported policy.", show_default=False),
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
OneAgent = Annotated[
    str | None,
    typer.Option(metavar="ID", help="RUN: one agent's parameters, not the mean of all."),
]
Seed = Annotated[int, typer.Option(min=0, help="Of all randomness.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def on(device: str | None, settings: Iterable[str] | None) -> list[str]:
    """The settings, with ``--device`` as one of them."""
    return [*(settings or ()), *([f'policy.device="{device}"'] if device else [])]
