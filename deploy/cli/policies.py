"""The commands about what was learned: ``swarm eval`` and ``swarm export``."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer()


class Form(StrEnum):
    """What a policy can be written as."""

    SAFETENSORS = "safetensors"
    ONNX = "onnx"


Source = Annotated[
    Path,
    typer.Argument(metavar="RUN|FILE", help="Run folder, or exported policy.", show_default=False),
]
OneAgent = Annotated[
    str | None, typer.Option(metavar="ID", help="Fly one agent's parameters, not the mean of all.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@app.command("eval")
def evaluate(
    source: Source,
    agent: OneAgent = None,
    scenes: Annotated[
        list[str] | None,
        typer.Option("--scene", metavar="NAME", help="World; repeatable; default: all."),
    ] = None,
    flights: Annotated[int, typer.Option(min=1, help="Flights in each world and mode.")] = 100,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: Annotated[int, typer.Option(min=0, help="Processes; 0: one per core.")] = 0,
    json: AsJson = False,
) -> None:
    """Fly a learned policy in every world, greedily and by its dice; also writes RUN/eval.json."""
    import msgspec  # noqa: PLC0415

    from agent.storage.runfolder import RunFolder  # noqa: PLC0415
    from deploy.policies.evaluate import evaluate as start  # noqa: PLC0415
    from deploy.policies.evaluate import print_evaluation  # noqa: PLC0415

    result = start(
        source, agent, flights, seed, jobs, scenes or (), lambda line: print(line, file=sys.stderr)
    )
    text = msgspec.json.format(msgspec.json.encode(result), indent=2)
    if source.is_dir():
        RunFolder(source).evaluation.write_bytes(text)
    print(text.decode()) if json else print_evaluation(result)


@app.command()
def export(
    source: Source,
    agent: OneAgent = None,
    form: Annotated[
        Form, typer.Option("--format", help="safetensors for us, onnx for everybody.")
    ] = Form.SAFETENSORS,
    to: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Default: RUN/policy.FORMAT.")
    ] = None,
) -> None:
    """Write the learned policy as one file: pictures in, action preferences out."""
    from agent.learning.pilot import Pilot  # noqa: PLC0415
    from deploy.policies.export import write_onnx  # noqa: PLC0415

    pilot = Pilot.load(source, agent)
    folder = source if source.is_dir() else source.parent
    path = to or folder / f"policy.{form.value}"
    if form is Form.ONNX:
        write_onnx(pilot, path)
    else:
        pilot.save(path)
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
