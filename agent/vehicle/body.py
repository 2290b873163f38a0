"""A drone in real time as the body of ``IndoorFlight-v0``: virtual rooms, a real flight stack.

Interface: :class:`VehicleBody`, and :func:`vehicle_bodies` by which an environment makes them::

    gymnasium.make("sim:IndoorFlight-v0", scene="indoor-long",
                   body="agent.vehicle.body:vehicle_bodies",
                   body_options={"vehicle": "udpin:0.0.0.0:14540"})

The origin of the vehicle's local frame is the scene's home, on the floor below its first start; the
axes are the scene's (north is north).  Nothing is teleported: the first episode begins above the
place where the drone stood, the next ones some metres back on the way that it has come, which is
free.  Between two steps, while somebody learns, it stands still.

While a person flies the drone, a step lasts: learning pauses, and goes on from where the drone is
given back (``safety`` says how).  A drone that its pilot has landed ends the agent.
"""

import logging
import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

from agent.errors import TakenOverError, VehicleError
from agent.vehicle.safety import Limits, Timing
from agent.vehicle.vehicle import Vehicle

log = logging.getLogger(__name__)

Pose = tuple[float, float, float, float, float, float]  # x, y, z [m], roll, pitch, yaw [rad]
Target = tuple[float, float, float, float]  # x, y, z [m], yaw [rad]
Course = tuple[float, float, float, float]  # velocity [m/s, NED], yaw [rad]

SPEED = 0.5  # m/s; at twice that, policies that learned without inertia touch walls
HEIGHT = 1.5  # m; where flights in the scenes start
AT_HOME = 1.0  # m from the origin
RETREAT = 4.0  # m, back on the way that it has come
NEAR = 0.25  # m, when a place is reached
AIMED = 0.15  # rad, when a heading is
RENEW = 0.1  # s between two set points on the way back
PATIENCE = 10.0  # s for a turn, and for a way besides the time that it takes
LATE = 3.0  # so many times longer than planned may a step last
GIVEN_UP = 3  # ways back
THINKING = 120.0  # s without a step, while somebody learns


class Site(Protocol):
    """Where a body flies, as ``IndoorFlight-v0`` says it."""

    @property
    def home(self) -> Pose:
        """The place on the floor where the vehicle's local frame has its origin."""
        ...


class VehicleBody:
    """Flies a drone that is connected already.

    Args:
        drone: on the ground; it takes off at the first ``place``.
        home: the origin of its local frame in the scene.
        speed: of a step [m/s].
        height: of the take-off [m].
        owner: whether closing the body lands the drone and lets go of it.
    """

    def __init__(
        self,
        drone: Vehicle,
        home: Pose,
        speed: float = SPEED,
        height: float = HEIGHT,
        *,
        owner: bool = False,
    ) -> None:
        if not 0 < speed <= drone.limits.speed:
            raise VehicleError(
                f"speed {speed:g} m/s: expected more than 0, at most {drone.limits.speed:g}"
            )
        self.drone, self._home, self._speed, self._height = drone, home, speed, height
        self._owner = owner
        self._trail: list[Target] = []  # where it has been in flight, in the local frame
        self._course: Course = (0.0, 0.0, 0.0, 0.0)  # of the step: m/s NED, rad
        self._due = 0  # ms since boot, when the step is over
        self._seconds = 0.0  # that a step lasts
        self._end = math.inf  # [monotonic s] when a step is given up
        self._lost = 0  # ways back in a row that took too long

    @property
    def pose(self) -> Pose:
        """Where its telemetry says that it is, in the frame of the scene."""
        state = self.drone.state
        x, y, z = (a + b for a, b in zip(state.position, self._home[:3], strict=True))
        return (x, y, z, *state.attitude)

    def place(self, pose: Pose, seed: int) -> None:
        """Be ready for an episode, wherever the environment would like to begin it.

        The first time it takes off, or goes on from where a lost agent left it in the air, and at
        home turns as the scene's start does; then it flies back a little.
        """
        del pose, seed
        if not self._trail:
            if not self.drone.take_over():
                self.drone.take_off(self._height)
            x, y, _ = self.drone.state.position
            self._turn(self._home[5] if math.hypot(x, y) < AT_HOME else self._yaw)
        else:
            try:
                self._retreat()
            except TakenOverError:
                self.drone.await_control()
                self._trail.clear()
        self._trail.append((*self.drone.state.position, self._yaw))

    def head_for(self, target: Target) -> None:
        """Fly at the velocity that leads to the target; the step lasts as long as that takes."""
        x, y, z = (a - b for a, b in zip(target[:3], self.pose[:3], strict=True))
        self._seconds = math.hypot(x, y, z) / self._speed
        self._due = self.drone.state.time_boot_ms + round(self._seconds * 1000)
        seconds = max(self._seconds, 1e-3)
        self._course = x / seconds, y / seconds, z / seconds, target[3]
        self._end = time.monotonic() + LATE * self._seconds + self.drone.timing.telemetry
        with suppress(TakenOverError):  # ``arrive`` deals with it
            self.drone.fly_at(*self._course)

    def arrive(self) -> None:
        """Fly on until the step is over, by the vehicle's own clock; or until it is given back."""
        try:
            while self.drone.state.time_boot_ms < self._due:
                if time.monotonic() > self._end:
                    raise VehicleError(f"{self.drone.name} does not report the end of a step")
                self.drone.fly_at(*self._course)  # again and again: a velocity alone soon ends
                self._pass(RENEW)
        except TakenOverError:
            self.drone.await_control()
            self._trail.clear()  # the way back leads elsewhere
        self._trail.append((*self.drone.state.position, self._yaw))

    def close(self) -> None:
        """Where the drone is ours, land, if that is still possible, and let go of it."""
        if not self._owner:
            return
        with suppress(VehicleError):
            if self.drone.state.armed and self.drone.ours:
                self.drone.land()
        self.drone.close()

    @property
    def _yaw(self) -> float:
        return self.drone.state.attitude[2]

    def _retreat(self) -> None:
        """Back on the trail, tail first; then turn as it was turned there.

        A way back that takes too long is given up and the episode begins here; it is an error only
        when that happens :data:`GIVEN_UP` times in a row.
        """
        here, way, yaw = self.drone.state.position, 0.0, self._yaw
        self._trail.pop()  # where it is, or nearly
        while self._trail and way < RETREAT:
            x, y, z, yaw_then = self._trail.pop()
            way += math.dist(here, (x, y, z))
            if not self._go((x, y, z), self._yaw):
                self._lost += 1
                log.warning("%s does not find its way back: going on here", self.drone.name)
                if self._lost >= GIVEN_UP:
                    raise VehicleError(
                        f"{self.drone.name} has not found its way back {GIVEN_UP} times in a row"
                    )
                return
            here, yaw = (x, y, z), yaw_then
        self._lost = 0
        self._turn(yaw)

    def _go(self, place: tuple[float, float, float], yaw: float) -> bool:
        """Straight to a place [m, local NED] at the speed of a step; False if it takes too long."""
        end = time.monotonic() + PATIENCE + LATE * math.dist(self.drone.state.position, place)
        while (away := math.dist(self.drone.state.position, place)) > NEAR:
            if time.monotonic() > end:
                return False
            speed = self._speed / away
            x, y, z = (
                speed * (a - b) for a, b in zip(place, self.drone.state.position, strict=True)
            )
            self.drone.fly_at(x, y, z, yaw)
            self._pass(RENEW)
        return True

    def _turn(self, yaw: float) -> None:
        """Stand here and look there."""
        x, y, z = self.drone.state.position
        end = time.monotonic() + PATIENCE
        while True:
            self.drone.fly_to(x, y, z, yaw)
            error = (self._yaw - yaw + math.pi) % (2 * math.pi) - math.pi
            if abs(error) < AIMED and math.hypot(*self.drone.state.velocity) < NEAR:
                return
            if time.monotonic() > end:
                raise VehicleError(
                    f"{self.drone.name} does not turn to {math.degrees(yaw):.0f} deg"
                )
            self._pass(RENEW)

    def _pass(self, seconds: float) -> None:
        """Let time pass, unless the flight is broken off."""
        end = time.monotonic() + seconds
        what = "sends no telemetry"
        self.drone.wait(lambda state: time.monotonic() >= end, self.drone.timing.link, what)


def vehicle_bodies(
    sites: Sequence[Site],
    *,
    vehicle: str | Sequence[str],
    speed: float = SPEED,
    system: int = 0,
    limits: dict[str, float] | None = None,
) -> list[VehicleBody]:
    """Connect to one drone for each site.

    Args:
        sites: where they fly.
        vehicle: connection string of each, see ``connection``.
        speed: of a step [m/s].
        system: the drone's system id; 0: whichever is heard first.
        limits: fields of ``safety.Limits`` that differ from their defaults.

    Raises:
        VehicleError: a drone is not there, or their number is not that of the sites.
        ValueError: a limit is none.
        TypeError: there is no such limit.
    """
    names = [vehicle] if isinstance(vehicle, str) else list(vehicle)
    if len(names) != len(sites):
        raise VehicleError(f"{len(names)} vehicles for {len(sites)} flights: expected as many")
    timing, bounds = replace(Timing(), policy=THINKING), Limits(**(limits or {}))
    bodies: list[VehicleBody] = []
    try:
        for name, site in zip(names, sites, strict=True):
            drone = Vehicle(name, timing, bounds, system=system).__enter__()
            bodies.append(VehicleBody(drone, site.home, speed, owner=True))
    except BaseException:
        for body in bodies:
            body.close()
        raise
    return bodies
