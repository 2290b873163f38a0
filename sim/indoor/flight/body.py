"""What flies: the ``Body`` protocol, the bodies by name, and the one that goes exactly as told.

Poses are NED: x north, y east, z down [m]; roll, pitch, yaw [rad], yaw clockwise from north seen
from above, applied first.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple, Protocol, cast, runtime_checkable

import numpy as np

from sim.indoor.content.scene import Scene, check_start
from sim.indoor.render.rays import cast_many


class Pose(NamedTuple):
    """Where a body is and how it is turned."""

    x: float
    y: float
    z: float
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


class SetPoint(NamedTuple):
    """Where a body is asked to be after the next step, and where its nose shall point."""

    x: float
    y: float
    z: float
    yaw: float


@runtime_checkable
class Body(Protocol):
    """Anything that can be sent from set point to set point.

    The environment places it at the start of a flight, then for every step asks for the pose, sends
    it off and waits for it; several bodies are all sent off before the first is waited for.
    Camera, collision and distance follow the pose that the body reports, wherever it flies.
    """

    @property
    def pose(self) -> tuple[float, float, float, float, float, float]:
        """Where the body is now."""
        ...

    def place(self, pose: Pose, seed: int) -> None:
        """Be at the start of a new flight: level, at rest; or as near to that as the body can.

        Whatever is chance in the flight that follows (gusts, noise) is drawn from `seed`.
        """
        ...

    def head_for(self, target: SetPoint) -> None:
        """Set out towards the set point, 0.4 m away; return at once."""
        ...

    def arrive(self) -> None:
        """Return when the time of the step is over, wherever the body then is."""
        ...

    def close(self) -> None:
        """Let go of whatever the body holds."""
        ...


class Site(NamedTuple):
    """Where one body of an environment flies."""

    scene: str  # name or file of the world
    home: Pose  # where it stands before it takes off
    flight: int  # its number in the environment


class KinematicBody:
    """PEDRA's static mode: it is where it is told to be, level, at once."""

    def __init__(self) -> None:
        self._pose = Pose(0.0, 0.0, 0.0)

    @property
    def pose(self) -> Pose:
        return self._pose

    def place(self, pose: Pose, seed: int) -> None:
        del seed  # nothing is chance here
        self._pose = pose

    def head_for(self, target: SetPoint) -> None:
        self._pose = Pose(target.x, target.y, target.z, yaw=target.yaw)

    def arrive(self) -> None:
        """It is there."""

    def close(self) -> None:
        """Nothing to let go of."""


BODIES = {"mavlink": "sim.vehicle.bodies:lockstep_bodies"}


def home_of(scene: Scene, start: int = 0) -> Pose:
    """The place on the floor below one of a scene's start poses, turned as that.

    Raises:
        ValueError: there is no such start.
    """
    check_start(scene.name, start, len(scene.starts))
    x, y, z, _, _, yaw = (float(value) for value in scene.starts[start])
    below, _ = cast_many(scene.mesh, 0, np.array([[x, y, z]]), np.array([[0.0, 0.0, 1.0]]))
    return Pose(x, y, z + float(below[0]), yaw=yaw)


def make_bodies(
    body: str | Body | Sequence[Body], scenes: Sequence[Scene], options: dict[str, Any] | None
) -> list[Body] | None:
    """One body for each flight; None where all are kinematic.

    Args:
        body: a name of :data:`BODIES`, ``"kinematic"``, ``"module:maker"`` or the bodies.
        scenes: the world of each flight.
        options: for the maker, called ``maker(sites, **options)``.

    Raises:
        ValueError: there is no such body, or their number is not that of the flights.
    """
    if isinstance(body, str) and body != "kinematic":
        module, _, name = BODIES.get(body, body).partition(":")
        if not name:
            names = ", ".join(["kinematic", *BODIES])
            raise ValueError(f"no body {body!r}: expected one of {names}, or 'module:maker'")
        sites = [Site(scene.name, home_of(scene), i) for i, scene in enumerate(scenes)]
        return cast("list[Body]", getattr(import_module(module), name)(sites, **(options or {})))
    if options:
        raise ValueError(f"body_options = {options}: expected none with this body")
    if isinstance(body, str):
        return None
    bodies = [body] if isinstance(body, Body) else list(body)
    if len(bodies) != len(scenes):
        raise ValueError(f"{len(bodies)} bodies for {len(scenes)} flights")
    return bodies
