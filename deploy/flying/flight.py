"""A flight with a real autopilot in a virtual world: ``swarm fly RUN --vehicle CONNECTION``.

The drone takes off, sees what ``IndoorFlight-v0`` shows from where its telemetry says that it is,
and flies what the pilot decides.  Where a flight ends at a wall it flies back a little and begins
the next.  Ctrl-C, an error and whatever safety objects to (``agent.vehicle.safety``) end in a
landing.  Beside a summary two recordings are kept: ``flight.tlog``, every MAVLink frame, and, where
Rerun is installed, ``flight.rrd``.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import msgspec
import numpy as np

from agent.errors import VehicleError
from agent.storage.appender import Appender
from agent.storage.files import write_file
from agent.storage.runs import RUNS
from agent.vehicle import Limits, Timing, Vehicle
from agent.vehicle.body import HEIGHT, SPEED, VehicleBody
from agent.vehicle.connection import parse
from deploy.flying.pilots import make_pilot
from deploy.process.news import News
from deploy.process.packages import needs
from deploy.process.signals import StoppedError, stopping_at_signals
from sim.indoor.content.scene import Scene, check, load
from sim.indoor.flight.body import Pose, home_of
from sim.indoor.flight.env import IndoorFlight, Observation
from sim.indoor.flight.flights import RADIUS, outside
from sim.indoor.geometry.collision import clearance
from swarm.errors import ConfigError

Decide = Callable[[IndoorFlight, Observation, bool], int]  # world, picture, first of a flight


@dataclass(frozen=True)
class Plan:
    """What is to be flown, and how."""

    vehicle: str  # connection string
    folder: Path  # of the recordings
    scene: str = "indoor-long"
    start: int = 0  # the origin of the vehicle's local frame is below this start pose
    speed: float = SPEED  # m/s
    height: float = HEIGHT  # m, of the take-off
    flights: int | None = None  # None: until Ctrl-C
    seed: int = 0
    system: int = 0  # of the vehicle; 0: whichever is heard first
    key: bytes | None = None
    limits: Limits = field(default_factory=Limits)
    timing: Timing = field(default_factory=Timing)


class Summary(msgspec.Struct, frozen=True):
    """What ``flight.json`` holds.

    Attributes:
        vehicle: who flew.
        scene: where.
        distances: of each flight [m]; the last one may have been told to stop.
        seconds: from take-off to landing.
        ended: why it landed.
    """

    vehicle: str
    scene: str
    distances: list[float]
    seconds: float
    ended: str


class Film(Protocol):
    """Takes what is to be seen; see ``deploy.viewer.film``."""

    def take(self, drone: Vehicle, world: IndoorFlight, reward: float) -> None:
        """One step."""
        ...

    def say(self, text: str) -> None:
        """One line of the log."""
        ...


def learned(source: Path, agent: str | None, *, greedy: bool, seed: int = 0) -> Decide:
    """What was learned, from a run folder or an exported file.

    Raises:
        ConfigError, CheckpointError: it cannot be read.
    """
    from agent.learning.pilot import Pilot  # noqa: PLC0415  (torch only where it is needed)

    pilot = Pilot.load(source, agent, seed)

    def decide(world: IndoorFlight, seen: Observation, fresh: bool) -> int:
        choice = pilot.choose(seen[None], greedy)
        if not np.isfinite(choice.log_probs).all():
            raise VehicleError("the policy's preferences are not numbers")
        return int(choice.actions[0])

    return decide


def handmade(name: str, seed: int = 0) -> Decide:
    """One of the hand-made pilots.

    Raises:
        ConfigError: there is none of this name.
    """
    try:
        pilot = make_pilot(name, seed, 1)
    except ValueError as error:
        raise ConfigError(str(error)) from None

    def decide(world: IndoorFlight, seen: Observation, fresh: bool) -> int:
        return int(pilot.act(world.depth[None], world.pose[None], np.array([fresh]))[0])

    return decide


def fly_vehicle(plan: Plan, decide: Decide, news: News) -> Summary:
    """Fly until the plan is fulfilled or the user has had enough; then land.

    Raises:
        ConfigError: there is no such world, or the folder cannot be written.
        VehicleError: the drone is not there, refuses, or the flight was broken off; it has been
            landed where that was possible.
    """
    if not 0 < plan.speed <= plan.limits.speed:
        raise ConfigError(
            f"speed {plan.speed:g} m/s: expected more than 0, at most {plan.limits.speed:g}"
        )
    parse(plan.vehicle)  # a mistake is told before anything takes its time
    try:
        check(plan.scene, plan.start)
        news.say(f"building {plan.scene}")
        scene = load(plan.scene)
        home = home_of(scene, plan.start)
        plan.folder.mkdir(parents=True, exist_ok=True)
        tape = Appender(plan.folder / "flight.tlog", warn=news.line)
    except (ValueError, OSError, ImportError) as error:
        raise ConfigError(str(error)) from None
    with ExitStack() as stack:
        stack.enter_context(tape)
        news.say("rehearsing on the ground")
        rehearse(plan.scene, decide)
        stack.enter_context(stopping_at_signals(patient=True))
        film = _film(stack, plan.folder / "flight.rrd", scene, news.line)

        def tell(text: str) -> None:
            with suppress(OSError):  # nothing that is only said may keep a drone from landing
                news.line(text)
                news.say(text)
                film.say(text)

        news.say(f"waiting for a vehicle on {plan.vehicle}")
        drone = stack.enter_context(
            Vehicle(
                plan.vehicle, plan.timing, plan.limits, system=plan.system, key=plan.key,
                record=tape,
            )
        )  # fmt: skip
        check_room(scene, home, drone, plan.height)
        tell(f"{drone.name} is on {plan.vehicle}; taking off, Ctrl-C lands")
        body = VehicleBody(drone, home, plan.speed, plan.height)
        world = IndoorFlight(plan.scene, body)
        distances: list[float] = []
        begun, ended = time.monotonic(), "all flights flown"
        try:
            _fly_on(plan, world, drone, decide, film, distances, tell, news)
        except StoppedError:
            ended = "told to stop"
        except VehicleError as error:
            ended = str(error)
            raise
        finally:
            if drone.ours:
                tell(f"landing: {ended}")
                _land(drone, ended)
                tell("landed")
            else:
                tell(f"left alone: {ended}{_flown_by(drone)}")
            summary = Summary(drone.name, plan.scene, distances, time.monotonic() - begun, ended)
            text = msgspec.json.format(msgspec.json.encode(summary), indent=2)
            write_file(plan.folder / "flight.json", text)
        return summary


def rehearse(scene: str, decide: Decide) -> None:
    """Two steps without a drone: what compiles or does not fit does so on the ground."""
    world = IndoorFlight(scene)
    seen, _ = world.reset(seed=0)
    for fresh in (True, False):
        seen, *_ = world.step(decide(world, seen, fresh))


def _fly_on(
    plan: Plan,
    world: IndoorFlight,
    drone: Vehicle,
    decide: Decide,
    film: Film,
    distances: list[float],
    tell: Callable[[str], None],
    news: News,
) -> None:
    """Flight after flight; `distances` grows with the one under way."""
    seen, _ = world.reset(seed=plan.seed)
    tell("in the air")
    while True:
        distances.append(0.0)
        fresh, crashed = True, False
        while not crashed:
            seen, reward, crashed, _, info = world.step(decide(world, seen, fresh))
            fresh = False
            distances[-1] = info["distance"]
            news.say(f"flight {len(distances)}, {distances[-1]:.1f} m")
            film.take(drone, world, reward)
        tell(f"flight {len(distances)}: {distances[-1]:.1f} m")
        if plan.flights is not None and len(distances) >= plan.flights:
            return
        seen, _ = world.reset()


def check_room(scene: Scene, home: Pose, drone: Vehicle, height: float) -> None:
    """See that the drone has room where it will begin: above where it stands, or where it flies.

    Raises:
        VehicleError: the virtual room has a wall there, or ends before.
    """
    x, y, z = (a + b for a, b in zip(drone.locate(), home[:3], strict=True))
    if drone.state.landed:
        z -= height
    room = clearance(scene.mesh, 0, np.array([x, y, z]), 2 * RADIUS)
    outdoors = outside(scene.mesh, 0, np.array([x, y, z]))
    if outdoors or room < RADIUS:
        where = "outside of it" if outdoors else f"{room:.2f} m from a surface"
        raise VehicleError(
            f"{drone.name} would begin at ({x:.1f}, {y:.1f}, {z:.1f}) of {scene.name}, {where}: "
            f"expected {RADIUS} m of room there; see --start"
        )


def _flown_by(drone: Vehicle) -> str:
    return f" ({drone.taken_over})" if drone.taken_over else ""


def _land(drone: Vehicle, why: str) -> None:
    """Land; if that fails, both reasons are told."""
    try:
        if drone.state.armed:
            drone.land()
    except VehicleError as error:
        raise VehicleError(f"{why}; {error}") from None


def folder_of(source: Path | None) -> Path:
    """Where a flight is kept: beside what flew."""
    stamp = time.strftime("%Y%m%d-%H%M%S")
    if source is None or not source.is_dir():
        return RUNS / f"flight-{stamp}"
    return source / "flights" / stamp


def report(summary: Summary, folder: Path, as_json: bool) -> None:
    """Print how it went."""
    if as_json:
        print(msgspec.json.format(msgspec.json.encode(summary), indent=2).decode())
        return
    print(
        f"{summary.vehicle} in {summary.scene}: {sum(summary.distances):.1f} m "
        f"in {len(summary.distances)} flights, {summary.seconds:.0f} s; recordings: {folder}"
    )


class _NoFilm:
    """Where Rerun is not installed, as on a drone's own computer."""

    def take(self, drone: Vehicle, world: IndoorFlight, reward: float) -> None:
        """Nothing."""

    def say(self, text: str) -> None:
        """Nothing."""


def _film(stack: ExitStack, path: Path, scene: Scene, say: Callable[[str], None]) -> Film:
    try:
        from deploy.viewer.film import FlightFilm  # noqa: PLC0415
    except ImportError:
        say(needs("rerun", "flight.rrd") or "no flight.rrd: rerun-sdk is not installed")
        return _NoFilm()
    return stack.enter_context(FlightFilm(path, scene))
