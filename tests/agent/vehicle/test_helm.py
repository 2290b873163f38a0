"""What is streamed, moment by moment, without a vehicle."""

import math
from dataclasses import replace
from typing import Any

import pytest

from agent.vehicle.dialects import ARDUPILOT, PX4, Dialect, Mode
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
        position_at=now, position=(0.0, 0.0, -2.0), velocity=(0.0, 0.0, 0.0), attitude_at=now,
    )  # fmt: skip


@pytest.fixture
def helm(dialect: Dialect) -> Helm:
    """Steering since time 0, obeyed."""
    return steering(Helm(Limits(), TIMING, "drone"), dialect)


def steering(helm: Helm, dialect: Dialect) -> Helm:
    helm.begin(HERE, 0.0)
    helm.obeyed(seen(dialect, 0.0), dialect)
    return helm


def flown(dialect: Dialect, mode: Mode, now: float, failsafe: bool = False) -> VehicleState:
    """A vehicle that reports another mode."""
    return replace(seen(dialect, now), custom_mode=dialect.custom_mode(mode), failsafe=failsafe)


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
    steering(helm, dialect)
    near = replace(seen(dialect, 0.1), position=(104.0, 0.0, -2.0))
    assert helm.tick(near, dialect, 0.1) == HERE
    far = replace(near, position=(104.0, 5.0, -2.0))
    assert helm.tick(far, dialect, 0.1) == dialect.hold
    assert "fence" in str(helm.broken)


PILOTS = [
    (PX4, mode) for mode in [(1, 0), (2, 0), (3, 0), (4, 3), (4, 4), (4, 5), (4, 6), (5, 0), (7, 0)]
] + [(ARDUPILOT, (mode, 0)) for mode in (0, 2, 3, 5, 6, 9, 16, 17, 21, 25)]


@pytest.mark.parametrize(("dialect", "mode"), PILOTS, ids=lambda value: str(value)[:12])
def test_what_a_person_chooses_is_left_alone(dialect: Dialect, mode: Mode) -> None:
    """For a minute, with everything wrong, no mode is asked for; given back, it flies again."""
    helm = steering(Helm(Limits(), TIMING, "drone"), dialect)
    assert helm.tick(seen(dialect, 0.1), dialect, 0.1) == HERE
    for k in range(1200):
        now = 0.15 + 0.05 * k
        state = flown(dialect, mode, now)
        if k > 100:
            state = replace(state, battery=0.01, position=(900.0, 0.0, -2.0), estimator_ok=False)
        sent = helm.tick(state, dialect, now)
        assert sent == (STAND_STILL if dialect.stream_first else None)
    assert helm.taken == f"{dialect.name_of(mode)}, chosen by a person" and helm.broken is None
    assert helm.tick(seen(dialect, now), dialect, now) == STAND_STILL
    assert helm.taken is None
    helm.wish(NORTH, now + 0.1)
    assert helm.tick(seen(dialect, now + 0.1), dialect, now + 0.1) == NORTH


def test_a_person_takes_over_while_we_hold_and_while_we_land(dialect: Dialect) -> None:
    rtl = (4, 5) if dialect is PX4 else (6, 0)
    for until, mode in ((2.2, dialect.hold), (5.6, dialect.land)):
        helm = steering(Helm(Limits(), TIMING, "drone"), dialect)
        state, now, last = seen(dialect, 0.0), 0.0, None
        while now < until:  # the policy is silent: it holds, then lands, and the vehicle obeys
            now += 0.05
            sent = helm.tick(replace(state, heartbeat_at=now, position_at=now, attitude_at=now),
                             dialect, now)  # fmt: skip
            if sent in {dialect.hold, dialect.land}:
                last = sent
                state = replace(state, custom_mode=dialect.custom_mode(last))
        assert last == mode and helm.broken is not None
        for k in range(100):
            now += 0.05
            sent = helm.tick(flown(dialect, rtl, now), dialect, now)
            assert sent == (STAND_STILL if dialect.stream_first else None), k


def test_a_person_who_is_faster_than_our_hold_has_the_drone(helm: Helm, dialect: Dialect) -> None:
    """Asked to hold, the vehicle reports what its pilot chose meanwhile."""
    assert helm.tick(seen(dialect, 2.1), dialect, 2.1) == dialect.hold
    rtl = (4, 5) if dialect is PX4 else (6, 0)
    for k in range(200):
        now = 2.2 + 0.05 * k
        assert helm.tick(flown(dialect, rtl, now), dialect, now) in {None, STAND_STILL}


def test_a_failsafe_that_flies_by_itself_is_left_alone(helm: Helm, dialect: Dialect) -> None:
    rtl = (4, 5) if dialect is PX4 else (6, 0)
    for k in range(200):
        now = 0.1 + 0.05 * k
        assert helm.tick(flown(dialect, rtl, now, True), dialect, now) in {None, STAND_STILL}
    assert "chosen by the autopilot's failsafe" in str(helm.taken)


def test_px4_that_lost_our_set_points_is_held_before_it_sinks_to_the_ground() -> None:
    """The link was cut for 3 s: PX4 goes to POSCTL and descends; when it is heard again, we act."""
    helm = steering(Helm(Limits(), TIMING, "drone"), PX4)
    now = 0.0
    while now < 3.0:
        now += 0.05
        helm.wish(HERE, now)
        helm.tick(replace(seen(PX4, now), heartbeat_at=0.0, position_at=0.0), PX4, now)
    sent = {helm.tick(flown(PX4, (3, 0), now + k / 20, True), PX4, now + k / 20) for k in range(9)}
    assert PX4.hold in sent
    assert helm.taken is None and helm.broken is not None


def test_disarmed_in_flight_is_a_persons_choice(helm: Helm, dialect: Dialect) -> None:
    state = replace(seen(dialect, 0.1), armed=False)
    assert helm.tick(state, dialect, 0.1) in {None, STAND_STILL}
    assert helm.taken == "disarmed, chosen by a person"


def test_old_attitude_jumps_and_restarts_break_a_flight_off(helm: Helm, dialect: Dialect) -> None:
    for wrong, said in (
        ({"attitude_at": 0.0, "unusable": "ATTITUDE.roll = nan"}, "no attitude"),
        ({"jump": 5.0, "jumped_at": 1.2}, "jumped by 5.0 m"),
        ({"restarts": 1}, "restarted"),
    ):
        steering(helm, dialect)
        helm.wish(HERE, 1.2)
        state = replace(seen(dialect, 1.3), **wrong)
        assert helm.tick(state, dialect, 1.3) == dialect.hold
        assert said in str(helm.broken)
