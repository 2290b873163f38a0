"""The commands about what was learned: ``swarm eval`` and ``swarm export``."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from deploy.cli.options import AsJson, OneAgent, Policy, Seed

app = typer.Typer()


@app.command("eval")
def evaluate(
    source: Policy,
    agent: OneAgent = None,
    scenes: Annotated[
        list[str] | None,
        typer.Option("--scene", metavar="NAME", help="World; repeatable; default: all."),
    ] = None,
    flights: Annotated[int, typer.Option(min=1, help="Flights in each world and mode.")] = 100,
    seed: Seed = 0,
    jobs: Annotated[int, typer.Option(min=0, help="Processes; 0: one per core.")] = 0,
    json: AsJson = False,
) -> None:
    """Fly a learned policy in every world; print how far.

    Greedily and stochastically; RUN/eval.json is written, too.
    """
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
    source: Policy,
    agent: OneAgent = None,
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="safetensors|onnx",
            help="For us, or for everybody; default: as FILE ends, else safetensors.",
        ),
    ] = None,
    to: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Default: RUN/policy.FORMAT.")
    ] = None,
) -> None:
    """Write the learned policy as one file.

    Observations in, action preferences out.
    """
    from deploy.policies.export import destination, export  # noqa: PLC0415

    path = export(source, agent, *destination(source, form, to))
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
