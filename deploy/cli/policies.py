"""The commands about what was learned: ``swarm eval`` and ``swarm export``."""

from pathlib import Path
from typing import Annotated

import typer

from deploy.cli.options import AsJson, OneAgent, Policy, Seed
from deploy.process.signals import stopping_at_signals

app = typer.Typer()


@app.command("eval")
def eval_(
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

    from agent.storage.files import write_file  # noqa: PLC0415
    from agent.storage.runfolder import RunFolder  # noqa: PLC0415
    from deploy.policies.evaluate import evaluate, print_evaluation  # noqa: PLC0415
    from deploy.policies.header import header_of  # noqa: PLC0415
    from deploy.process.news import working  # noqa: PLC0415

    if not json and source.suffix == ".safetensors" and (header := header_of(source)):
        print(*header.lines(), sep="\n", flush=True)
    with working(f"evaluating {source}") as news, stopping_at_signals():
        result = evaluate(source, agent, flights, seed, jobs, scenes or (), news.line, news.say)
    text = msgspec.json.format(msgspec.json.encode(result), indent=2)
    if source.is_dir():
        write_file(RunFolder(source).evaluation, text)
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
        Path | None, typer.Option(metavar="FILE", help="Default: policy.FORMAT in RUN, or here.")
    ] = None,
    licence: Annotated[
        str, typer.Option(metavar="SPDX", help="Licence of the policy, e.g. Apache-2.0.")
    ] = "",
) -> None:
    """Write the learned policy as one file.

    Observations in, action preferences out.  The file says where it comes from, what its actions
    mean and, after "swarm eval", how far it flies; "swarm eval FILE" begins with that.
    """
    from deploy.policies.export import destination, export  # noqa: PLC0415
    from deploy.process.news import working  # noqa: PLC0415

    chosen, path = destination(source, form, to)
    with working(f"writing {path}"), stopping_at_signals():
        export(source, agent, chosen, path, licence)
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
