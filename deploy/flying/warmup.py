"""One process compiles the kernels and bakes the light before several need them at once.

All that is made lies in caches (:mod:`sim.kernels`, :mod:`sim.indoor.content.scene`), where the
processes that start afterwards find it.  With warm caches it takes a second or two.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from agent.config.experiment import Task

if TYPE_CHECKING:
    from sim.vehicle.quadrotor import World

FLIGHT = "sim:IndoorFlight-v0"
APART = ("body", "body_options")  # arguments that start or connect something


def warm_up(tasks: Iterable[Task]) -> None:
    """Build every world in which somebody flies, and take a step in it.

    Raises:
        ValueError, OSError: a world cannot be built.
    """
    scenes: set[str] = set()
    for task in tasks:
        scene = str(task.kwargs.get("scene", ""))
        if task.env != FLIGHT or scene in scenes:
            continue
        scenes.add(scene)
        settings = {key: value for key, value in task.kwargs.items() if key not in APART}
        _take_a_step(settings, "body" in task.kwargs)


def _take_a_step(settings: dict[str, Any], with_body: bool) -> None:
    """With a kinematic flight, and where a body flies, as bodies fly."""
    from sim.indoor.flight.body import KinematicBody  # noqa: PLC0415  (numba where it is needed)
    from sim.indoor.flight.env import IndoorFlight  # noqa: PLC0415

    for world in (
        IndoorFlight(**settings),
        *([IndoorFlight(**settings, body=KinematicBody())] if with_body else []),
    ):
        world.reset(seed=0)
        world.step(0)
        world.close()
    if with_body:
        rehearse_vehicle(None)


def rehearse_vehicle(world: "World | None") -> None:
    """What a simulated vehicle computes, once: standing on its legs, and holding its place."""
    from sim.vehicle.control import Speeds  # noqa: PLC0415  (numba where it is needed)
    from sim.vehicle.quadrotor import Quadrotor  # noqa: PLC0415
    from sim.vehicle.setpoints import hold_at  # noqa: PLC0415

    body = Quadrotor(world=world)
    for target in (None, hold_at(body.position)):
        body.advance(target, Speeds(1.0, 1.0, 1.0))
