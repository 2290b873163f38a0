"""Small worlds that the tests share.  They are unlit: light is baked only where it is tested."""

import numpy as np
import pytest

from sim.indoor.content.plan import Plan
from sim.indoor.content.scene import Scene, build, load
from sim.indoor.content.scenes import NAMES
from sim.indoor.content.textures import Material, plain
from sim.indoor.geometry.shapes import box, circle, prism

WHITE = plain("#ffffff")


def bare_room(
    width: float = 10.0, depth: float = 8.0, height: float = 3.0, floor: Material = WHITE
) -> Plan:
    """x 0..width east, y 0..depth north."""
    plan = Plan(height=height)
    plan.room(
        [(0, 0), (width, 0), (width, depth), (0, depth)],
        floor=floor,
        ceiling=WHITE,
        walls=[plain("#ff0000"), plain("#00ff00"), plain("#0000ff"), WHITE],
    )
    plan.start(width / 2, depth / 2, 0)
    return plan


@pytest.fixture(scope="session")
def room() -> Scene:
    """An empty room, 10 m east, 8 m north, 3 m high; its south wall is red, then anticlockwise."""
    return build("room", bare_room(), lit=False)


@pytest.fixture(scope="session")
def cluttered() -> Scene:
    """The room with boxes, a pillar and a slanted block: something of everything."""
    plan = bare_room()
    rng = np.random.default_rng(5)
    for _ in range(25):
        x, y = rng.uniform(0.5, 9.0), rng.uniform(0.5, 7.0)
        w, d, h = rng.uniform(0.1, 0.9, 3)
        plan.faces += box((x, x + w), (y, y + d), (0.0, 2.2 * h), WHITE)
    plan.faces += prism(circle((5, 4), 0.4, 12), 0.0, 3.0, WHITE)
    plan.faces += prism([(7, 6), (8, 6), (7.5, 7)], 0.4, 1.9, WHITE, WHITE, WHITE, taper=0.5)
    return build("cluttered", plan, lit=False)


@pytest.fixture(scope="session", params=NAMES)
def world(request: pytest.FixtureRequest) -> Scene:
    """Each of our worlds in turn."""
    return load(request.param, lit=False)


@pytest.fixture(scope="session")
def edge_world() -> Scene:
    """A box of one metre with a corner at the origin, alone."""
    plan = Plan()
    plan.faces += box((0, 1), (0, 1), (0, 1), WHITE)
    return build("box", plan, lit=False)
