"""What flies: the ``Body`` protocol, and the kinematic body that goes exactly where it is told.

Poses are NED: x north, y east, z down [m]; roll, pitch, yaw [rad], yaw clockwise from north seen
from above, applied first.
"""

from importlib import import_module
from typing import NamedTuple, Protocol, cast, runtime_checkable


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

    The environment places it at the start of a flight, then alternates ``advance`` and ``pose``.
    Camera, collision and distance follow the pose that the body reports, wherever it flies.
    """

    @property
    def pose(self) -> Pose:
        """Where the body is now."""
        ...

    def place(self, pose: Pose) -> None:
        """Be at the start of a new flight: level, at rest."""
        ...

    def advance(self, target: SetPoint) -> None:
        """Fly for the time of one step (0.4 m) towards the set point; return when it is over."""
        ...

    def close(self) -> None:
        """Let go of whatever the body holds."""
        ...


class KinematicBody:
    """PEDRA's static mode: it is where it is told to be, level, at once."""

    def __init__(self) -> None:
        self._pose = Pose(0.0, 0.0, 0.0)

    @property
    def pose(self) -> Pose:
        return self._pose

    def place(self, pose: Pose) -> None:
        self._pose = pose

    def advance(self, target: SetPoint) -> None:
        self._pose = Pose(target.x, target.y, target.z, yaw=target.yaw)

    def close(self) -> None:
        """Nothing to let go of."""


BODIES = {"kinematic": "sim.indoor.body:KinematicBody"}


def make_body(body: str | Body) -> Body:
    """A body by its name, by ``package.module:Class``, or the object itself."""
    if not isinstance(body, str):
        return body
    entry = BODIES.get(body, body)
    module, _, name = entry.partition(":")
    if not name:
        raise ValueError(f"no body {body!r}: expected one of {sorted(BODIES)} or 'module:Class'")
    return cast(Body, getattr(import_module(module), name)())
