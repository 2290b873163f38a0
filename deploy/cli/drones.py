"""The commands about drones and their worlds: ``swarm vehicle``, ``fly`` and ``worlds``."""

from pathlib import Path
from typing import Annotated

import typer

from deploy.cli.mistakes import plain_errors
from deploy.cli.options import AsJson, MaybePolicy, OneAgent, Scenes, Seed
from swarm.errors import ConfigError

app = typer.Typer()


@app.command()
def vehicle(
    port: Annotated[
        int, typer.Option(help="UDP: companions listen here, we on port + 40; TCP: we do.")
    ] = 14540,
    sysid: Annotated[int, typer.Option(help="MAVLink system id.")] = 1,
    scene: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="World to fly in; default: an open field."),
    ] = None,
    start: Annotated[
        int, typer.Option(min=0, help="Home is below this start pose of the scene.")
    ] = 0,
    flavour: Annotated[str, typer.Option(help="Whose behaviour: px4 or ardupilot.")] = "px4",
    speed: Annotated[float, typer.Option(help="Simulated seconds per second.")] = 1.0,
    lockstep: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Advance by this much, only when told."),
    ] = None,
    tcp: Annotated[bool, typer.Option("--tcp", help="Listen on TCP instead of UDP.")] = False,
    host: Annotated[str, typer.Option(help="Send there; not 127.0.0.1: listen everywhere.")] = (
        "127.0.0.1"
    ),
    ground_port: Annotated[
        int, typer.Option(help="UDP: a ground station listens here; 0: none.")
    ] = 14550,
    signing_key: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Sign messages; believe only signed ones."),
    ] = None,
    wind: Annotated[
        str | None, typer.Option(metavar="N,E[,GUSTS]", help="Wind [m/s], north and east.")
    ] = None,
    noise: Annotated[bool, typer.Option("--noise", help="Imperfect sensors.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of gusts and noise.")] = 0,
) -> None:
    """Run one simulated vehicle that speaks MAVLink.

    SIGTERM or Ctrl-C ends it.
    """
    from deploy.flying.vehicle import read_key, read_wind, run_vehicle  # noqa: PLC0415
    from sim.vehicle.flavours import FLAVOURS  # noqa: PLC0415
    from sim.vehicle.quadrotor import NOISY, Noise, Weather  # noqa: PLC0415
    from sim.vehicle.server import Options  # noqa: PLC0415

    if flavour not in FLAVOURS:
        raise ConfigError(f'flavour "{flavour}": expected one of {", ".join(FLAVOURS)}')
    with plain_errors():
        options = Options(
            port=port,
            system=sysid,
            flavour=FLAVOURS[flavour],
            speed=speed,
            lockstep=lockstep,
            tcp=tcp,
            host=host,
            ground_port=ground_port or None,
            key=read_key(signing_key) if signing_key is not None else None,
            weather=read_wind(wind) if wind is not None else Weather(),
            noise=NOISY if noise else Noise(),
            seed=seed,
            scene=scene,
            start=start,
        )
    run_vehicle(options)


@app.command()
def fly(
    source: MaybePolicy = None,
    vehicle: Annotated[
        str | None,
        typer.Option(metavar="CONNECTION", help="Fly this drone, e.g. udpin:0.0.0.0:14540."),
    ] = None,
    pilot: Annotated[
        str | None, typer.Option(help="Instead of RUN: greedy (the default), straight or random.")
    ] = None,
    scenes: Annotated[
        list[str] | None,
        typer.Option(
            "--scene",
            metavar="NAME|FILE",
            help="World; repeatable without --vehicle; default: all.",
        ),
    ] = None,
    flights: Annotated[
        int | None,
        typer.Option(min=1, help="In each world, default 16; with --vehicle default until Ctrl-C."),
    ] = None,
    seed: Seed = 0,
    json: AsJson = False,
    agent: OneAgent = None,
    stochastic: Annotated[
        bool,
        typer.Option("--stochastic", help="RUN: draw actions as in training, not the likeliest."),
    ] = False,
    start: Annotated[
        int, typer.Option(min=0, help="--vehicle: its local origin is below this start pose.")
    ] = 0,
    speed: Annotated[float, typer.Option(help="--vehicle: of a step [m/s].")] = 0.5,
    fence: Annotated[float, typer.Option(help="--vehicle: farthest from take-off [m].")] = 100.0,
    battery: Annotated[
        float, typer.Option(min=0, max=1, help="--vehicle: lands below this share.")
    ] = 0.15,
    sysid: Annotated[
        int, typer.Option(min=0, help="--vehicle: its system id; 0: whichever is heard first.")
    ] = 0,
    signing_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="--vehicle: sign messages.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="--vehicle: of the recordings; default in RUN/flights."),
    ] = None,
) -> None:
    """Fly a drone by what was learned; or measure hand-made pilots.

    With --vehicle the drone takes off and flies in a virtual world, by the policy of RUN or by a
    hand-made pilot; Ctrl-C lands it.  Without, hand-made pilots fly the worlds and their mean safe
    flight [m] is printed; for that of a learned policy see "swarm eval".
    """
    from sim.indoor.content.scenes import NAMES  # noqa: PLC0415

    if source is not None and (pilot is not None or vehicle is None):
        raise ConfigError("RUN needs --vehicle and no --pilot: without a vehicle use swarm eval")
    if vehicle is None:
        from deploy.flying.measure import measure_pilot  # noqa: PLC0415

        with plain_errors():
            measure_pilot(pilot or "greedy", scenes or NAMES, flights or 16, seed, as_json=json)
        return
    from agent.vehicle import Limits  # noqa: PLC0415
    from deploy.flying.flight import (  # noqa: PLC0415
        Plan,
        fly_vehicle,
        folder_of,
        handmade,
        learned,
        report,
    )
    from deploy.flying.vehicle import read_key  # noqa: PLC0415
    from deploy.process.news import working  # noqa: PLC0415

    if scenes is not None and len(scenes) != 1:
        raise ConfigError(f"{len(scenes)} worlds for one drone: expected one --scene")
    with plain_errors():
        plan = Plan(
            vehicle=vehicle,
            folder=out or folder_of(source),
            scene=(scenes or NAMES)[0],
            start=start,
            speed=speed,
            flights=flights,
            seed=seed,
            system=sysid,
            key=read_key(signing_key) if signing_key is not None else None,
            limits=Limits(fence=fence, battery=battery),
        )
    with working(f"flying {vehicle}") as news:
        if source is None:
            decide = handmade(pilot or "greedy", seed)
        else:
            decide = learned(source, agent, greedy=not stochastic, seed=seed)
        summary = fly_vehicle(plan, decide, news)
    report(summary, plan.folder, json)


@app.command()
def worlds(
    scenes: Scenes = None,
    sheet: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Write a contact sheet.")
    ] = None,
    width: Annotated[int | None, typer.Option(min=100, help="Of the sheet [pixels].")] = None,
) -> None:
    """Show the indoor worlds.

    A table, and with --sheet their plans and views as a picture.
    """
    from deploy.flying.sheet import worlds as show  # noqa: PLC0415
    from deploy.process.news import working  # noqa: PLC0415
    from sim.indoor.content.scenes import NAMES  # noqa: PLC0415

    with plain_errors(), working("building the worlds"):
        show(scenes or NAMES, sheet, width)
