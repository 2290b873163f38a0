"""Safety decisions, by table."""

import math

import pytest

from agent.errors import VehicleError
from agent.vehicle.dialects import ARDUPILOT, PX4, dialect_of
from agent.vehicle.safety import Action, Chosen, Health, Limits, Timing, decide

LIMITS, TIMING = Limits(fence=50.0, height=10.0, battery=0.2), Timing()


@pytest.mark.parametrize(
    ("health", "action", "words"),
    [
        (Health(), Action.FLY, ""),
        (Health(heartbeat_age=2.9, position_age=0.9, setpoint_age=1.9), Action.FLY, ""),
        (Health(heartbeat_age=3.1), Action.HOLD, "link lost"),
        (Health(position_age=1.1), Action.HOLD, "telemetry stale"),
        (Health(position_age=math.inf), Action.HOLD, "telemetry stale"),
        (Health(setpoint_age=2.1), Action.HOLD, "policy stale"),
        (Health(attitude_age=1.1, unusable="ATTITUDE.roll = nan"), Action.HOLD, "ATTITUDE.roll"),
        (Health(position_age=1.1, unusable="x = inf"), Action.HOLD, "no position for 1.1 s (x ="),
        (Health(finite=False), Action.HOLD, "not a number"),
        (Health(jump=5.0), Action.HOLD, "jumped by 5.0 m"),
        (Health(restarted=True), Action.HOLD, "restarted"),
        (Health(estimator_ok=False), Action.HOLD, "estimator"),
        (Health(distance=51.9, height=11.9), Action.FLY, ""),
        (Health(distance=52.1), Action.HOLD, "fence"),
        (Health(height=12.1), Action.HOLD, "fence"),
        (Health(battery=0.2), Action.FLY, ""),
        (Health(battery=0.19), Action.HOLD, "battery 19%"),
        (Health(battery=None), Action.FLY, ""),
        (Health(chosen=Chosen.BY_A_PERSON, mode="RTL"), Action.SILENT, "RTL, chosen by a person"),
        (Health(chosen=Chosen.BY_FAILSAFE, mode="RTL"), Action.SILENT, "failsafe"),
        (Health(chosen=Chosen.FOR_WANT_OF_US, mode="POSCTL"), Action.HOLD, "for want of our set"),
        # what a person chose is never overridden, whatever is wrong
        (Health(chosen=Chosen.BY_A_PERSON, heartbeat_age=9.0), Action.SILENT, "person"),
        (Health(chosen=Chosen.BY_A_PERSON, battery=0.01, distance=900.0), Action.SILENT, "person"),
        (Health(chosen=Chosen.BY_A_PERSON, held=9.0), Action.SILENT, "person"),
        (Health(chosen=Chosen.BY_FAILSAFE, held=9.0), Action.SILENT, "failsafe"),
        (Health(chosen=Chosen.FOR_WANT_OF_US, held=9.0), Action.LAND, "held"),
        (Health(held=0.0), Action.HOLD, "held"),
        (Health(held=2.9), Action.HOLD, "held"),
        (Health(held=3.0), Action.LAND, "held"),
        (Health(held=9.0, position_age=9.0), Action.LAND, "held"),
    ],
)
def test_what_to_do(health: Health, action: Action, words: str) -> None:
    decided, reason = decide(health, LIMITS, TIMING)
    assert decided is action
    assert words in reason
    assert "\n" not in reason


def test_speeds_and_places_are_shortened_not_turned() -> None:
    limits = Limits(speed=2.0, fence=10.0, height=5.0)
    assert limits.speed_within(3.0, 0.0, -4.0) == pytest.approx((1.2, 0.0, -1.6))
    assert limits.speed_within(1.0, 0.0, 0.0) == (1.0, 0.0, 0.0)
    assert limits.speed_within(0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)
    home = (1.0, 0.0, 0.0)
    assert limits.place_within(31.0, 40.0, -9.0, home) == pytest.approx((7.0, 8.0, -5.0))
    assert limits.place_within(2.0, 1.0, -3.0, home) == (2.0, 1.0, -3.0)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_limits_are_positive_numbers(bad: float) -> None:
    with pytest.raises(ValueError, match="limit fence"):
        Limits(fence=bad)


def test_dialects() -> None:
    assert dialect_of(12) is PX4
    assert dialect_of(3) is ARDUPILOT
    assert PX4.custom_mode(PX4.guided) == 0x60000
    assert ARDUPILOT.custom_mode(ARDUPILOT.land) == 9
    for dialect, name in ((PX4, "AUTO.LAND"), (ARDUPILOT, "LAND")):
        assert dialect.mode(dialect.custom_mode(dialect.land)) == dialect.land
        assert dialect.name_of(dialect.land) == name
    assert ARDUPILOT.name_of((99, 0)) == "mode 99.0"
    with pytest.raises(VehicleError, match="autopilot 8 is not known"):
        dialect_of(8)
