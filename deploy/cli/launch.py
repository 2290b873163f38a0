"""The commands that start agents: ``swarm up`` and ``swarm agent``."""

import os
import threading
from pathlib import Path
from typing import Annotated

import typer

from agent.config.experiment import load
from agent.daemon.joining import fetch_config
from agent.daemon.process import run_agent
from agent.storage.runfolder import RunFolder
from agent.storage.runs import RUNS, check_own_folder
from deploy.cli.options import Chaos, Device, MaybeFile, Settings, on
from deploy.process.logs import log_to
from deploy.process.news import working
from deploy.process.signals import say_when_stopped, stop_on_signals
from swarm.wire.keys import check_name

app = typer.Typer()


@app.command()
def up(
    file: MaybeFile = None,
    settings: Settings = None,
    resume: Annotated[
        Path | None, typer.Option(metavar="RUN", help="Go on with this run folder instead.")
    ] = None,
    run: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Run folder; default runs/NAME-DATE.")
    ] = None,
    record: Annotated[bool, typer.Option(help="Write recording.rrd for Rerun.")] = True,
    chaos: Chaos = None,
    device: Device = None,
) -> None:
    """Run all agents of a swarm file, to their result."""
    from deploy.chaos.faults import load_faults  # noqa: PLC0415
    from deploy.launch.preparation import prepare  # noqa: PLC0415
    from deploy.launch.preparation import resume as prepare_again  # noqa: PLC0415
    from deploy.launch.up import launch, show_finished  # noqa: PLC0415

    if (file is None) == (resume is None):
        raise typer.BadParameter("expected either FILE or --resume RUN")
    settings = on(device, settings, file or (resume and resume / "config.json"))
    say_when_stopped("stopped before anything had begun; the same command begins again")
    if resume is not None:
        if show_finished(resume, settings):
            return
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
    file: MaybeFile = None,
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
    """Run one agent, as a drone would.

    SIGTERM or Ctrl-C ends it with a checkpoint.
    """
    if (file is None) == (join is None):
        raise typer.BadParameter("expected either FILE or --join NAME")
    if connect and join is None:
        raise typer.BadParameter("--connect goes with --join: FILE has its endpoints")
    settings = on(device, settings, file)
    config = load(file, settings) if file is not None else None
    if config is not None:
        config.index(id_)
    name = config.name if config is not None else check_name("--join", join or "")
    if run is not None:
        check_own_folder("--run", run)
    folder = RunFolder(run or RUNS / name)
    stop, announced = threading.Event(), threading.Event()

    def listen() -> None:
        announced.set()
        stop_on_signals(stop)

    folder.prepare(id_)
    log_to(folder.log(id_), id_, quiet=supervised, as_json=json_logs)
    if config is None:
        with working(f"asking swarm {name} for its file"):
            config = fetch_config(name, id_, connect or (), settings)
        folder.write_config(config)
    if supervised:
        watch = threading.Thread(target=_stop_at_end_of_input, args=(stop, announced), daemon=True)
        watch.start()
    run_agent(config, id_, folder, stop, listen, resume, begin, metrics)


def _stop_at_end_of_input(stop: threading.Event, announced: threading.Event) -> None:
    """Stop when whoever started us is gone; at once where there is nothing to put away yet."""
    while os.read(0, 4096):  # not sys.stdin: its lock would be held at interpreter shutdown
        pass
    stop.set()
    if not announced.is_set():
        os._exit(1)
