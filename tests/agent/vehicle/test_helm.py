"""What is streamed, moment by moment, without a vehicle."""

import math
from dataclasses import replace
from typing import Any

import pytest

from agent.vehicle.dialects import ARDUPILOT, PX4, Dialect
from agent.vehicle.helm import LOCAL_NED, POSITION_YAW, STAND_STILL, VELOCITY_YAW, Helm, SetPoint
from agent.vehicle.safety import Limits, Timing
from agent.vehicle.state import VehicleState

TIMING = Timing(coast=0.5, policy=2.0, hold=3.0, retry=0.7)
HERE = SetPoint(LOCAL_NED, POSITION_YAW, (0.0, 0.0, -2.0))
NORTH = SetPoint(LOCAL_NED, VELOCITY_YAW, velocity=(1.0, 0.0, 0.0))


@pytest.fixture(params=[PX4, ARDUPILOT], ids=lambda dialect: dialect.name)
def dialect(request: pytest.FixtureRequest) -> Dialect:
    return request.param  # type: ignore[no-any-return]


def seen(dialect: Dialect, now: float) -> VehicleState:
    """A vehicle that flies our set points, heard just now."""
    return VehicleState(
        heartbeat_at=now, armed=True, custom_mode=dialect.custom_mode(dialect.guided),
        position_at=now, position=(0.0, 0.0, -2.0), velocity=(0.0, 0.0, 0.0),
    )  # fmt: skip


@pytest.fixture
def helm() -> Helm:
    """Steering since time 0, obeyed."""
    helm = Helm(Limits(), TIMING, "drone")
    helm.begin(HERE, 0.0)
    helm.obeyed()
    return helm


def test_nothing_is_sent_before_and_after(dialect: Dialect) -> None:
    helm = Helm(Limits(), TIMING, "drone")
    assert helm.tick(seen(dialect, 0.0), dialect, 0.0) is None
    helm.begin(HERE, 0.0)
    assert helm.steering and helm.tick(VehicleState(), dialect, 9.0) == HERE  # not yet obeyed
    helm.release()
    assert helm.tick(seen(dialect, 0.0), dialect, 0.0) is None


def test_a_velocity_coasts_to_a_stop_and_a_place_is_kept(helm: Helm, dialect: Dialect) -> None:
    helm.wish(NORTH, 1.0)
    assert helm.tick(seen(dialect, 1.4), dialect, 1.4) == NORTH
    assert helm.tick(seen(dialect, 1.6), dialect, 1.6) == STAND_STILL
    helm.wish(HERE, 2.0)
    assert helm.tick(seen(dialect, 3.9), dialect, 3.9) == HERE
    assert helm.broken is None


def test_what_is_wrong_holds_then_lands_and_insists(helm: Helm, dialect: Dialect) -> None:
    assert helm.tick(seen(dialect, 2.1), dialect, 2.1) == dialect.hold
    assert "policy stale" in str(helm.broken)
    assert helm.tick(seen(dialect, 2.2), dialect, 2.2) is None  # asked just now
    helm.wish(NORTH, 2.3)  # too late
    assert helm.tick(seen(dialect, 2.9), dialect, 2.9) == dialect.hold
    holding = replace(seen(dialect, 3.7), custom_mode=dialect.custom_mode(dialect.hold))
    assert helm.tick(holding, dialect, 3.7) is None  # obeyed
    assert helm.tick(holding, dialect, 5.2) == dialect.land
    down = replace(holding, armed=False)
    assert helm.tick(down, dialect, 9.0) is None


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e7])
@pytest.mark.parametrize("field", ["place", "velocity", "yaw", "turn"])
def test_numbers_that_are_none_are_never_sent(
    helm: Helm, dialect: Dialect, field: str, bad: float
) -> None:
    value: Any = (0.0, bad, 0.0) if field in {"place", "velocity"} else bad
    helm.wish(NORTH._replace(**{field: value}), 0.1)
    assert helm.tick(seen(dialect, 0.1), dialect, 0.1) == dialect.hold
    assert "not a number" in str(helm.broken)


def test_a_new_flight_forgets_the_old_one(helm: Helm, dialect: Dialect) -> None:
    helm.tick(seen(dialect, 2.1), dialect, 2.1)
    assert helm.broken
    helm.begin(HERE, 20.0)
    assert helm.broken is None
    assert helm.tick(seen(dialect, 20.1), dialect, 20.1) == HERE


def test_the_fence_counts_from_the_place_of_take_off(dialect: Dialect) -> None:
    helm = Helm(Limits(fence=5.0, margin=1.0), TIMING, "drone")
    helm.home = (100.0, 0.0, 0.0)
    helm.begin(HERE, 0.0)
    helm.obeyed()
    near = replace(seen(dialect, 0.1), position=(104.0, 0.0, -2.0))
    assert helm.tick(near, dialect, 0.1) == HERE
    far = replace(near, position=(104.0, 5.0, -2.0))
    assert helm.tick(far, dialect, 0.1) == dialect.hold
    assert "fence" in str(helm.broken)
