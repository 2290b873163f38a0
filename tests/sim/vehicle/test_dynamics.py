"""The rigid body against closed forms."""

import math

import numpy as np
import pytest

from sim.vehicle.airframe import FILE, load
from sim.vehicle.control import mix
from sim.vehicle.dynamics import SUBSTEP, at_rest, energy, substep
from sim.vehicle.frames import Doubles, euler_from_quaternion

AIRFRAME, GAINS = load()
FREE = AIRFRAME._replace(linear_drag=1e-12, angular_drag=1e-12)
CALM, OFF = np.zeros(3), np.zeros(4)
WEIGHT = AIRFRAME.mass * AIRFRAME.gravity


def run(state: Doubles, command: Doubles, seconds: float, airframe=FREE, wind=CALM) -> None:  # type: ignore[no-untyped-def]
    for _ in range(round(seconds / SUBSTEP)):
        substep(state, command, wind, 1e9, airframe, SUBSTEP)


def test_free_fall() -> None:
    state = at_rest(0.0, 0.0, -100.0, 0.0, 0.0)
    run(state, OFF, 2.0)
    assert state[5] == pytest.approx(FREE.gravity * 2.0, rel=1e-9)
    assert state[2] == pytest.approx(-100 + 0.5 * FREE.gravity * 4.0, rel=1e-9)


def test_a_thrown_body_keeps_its_energy() -> None:
    state = at_rest(0.0, 0.0, -50.0, 0.0, 0.0)
    state[3:6] = 3.0, -2.0, -5.0
    state[10:13] = 0.0, 0.0, 4.0
    before = energy(state, FREE)
    run(state, OFF, 3.0)
    assert energy(state, FREE) == pytest.approx(before, rel=1e-9)


def test_a_tumbling_body_keeps_its_angular_momentum_roughly() -> None:
    """Euler's equation by Euler's step: spin about three axes for a second, within 1%."""
    state = at_rest(0.0, 0.0, -50.0, 0.0, 0.0)
    state[10:13] = 1.0, 2.0, 3.0
    inertia = np.array([FREE.inertia_x, FREE.inertia_y, FREE.inertia_z])
    before = np.linalg.norm(inertia * state[10:13])
    run(state, OFF, 1.0)
    assert np.linalg.norm(inertia * state[10:13]) == pytest.approx(before, rel=0.01)


def test_hover_thrust_carries_the_weight() -> None:
    state = at_rest(0.0, 0.0, -2.0, 0.7, WEIGHT / 4)
    run(state, np.full(4, WEIGHT / 4), 5.0)
    assert state[0:3] == pytest.approx((0.0, 0.0, -2.0), abs=1e-9)
    assert state[3:6] == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert euler_from_quaternion(state[6:10])[2] == pytest.approx(0.7)


def test_rotors_lag_by_their_time_constant() -> None:
    state = at_rest(0.0, 0.0, -2.0, 0.0, 0.0)
    run(state, np.ones(4), AIRFRAME.rotor_lag - 0.002)  # 12 substeps: 48 ms
    assert state[13:17] == pytest.approx(np.full(4, 1 - math.exp(-0.048 / 0.05)))


def test_drag_leads_to_the_terminal_speed() -> None:
    """m g = k v, reached with time constant m / k; the wind carries along."""
    state = at_rest(0.0, 0.0, -1e4, 0.0, 0.0)
    tau = AIRFRAME.mass / AIRFRAME.linear_drag
    run(state, OFF, 2 * tau, AIRFRAME, np.array([4.0, 0.0, 0.0]))
    terminal = WEIGHT / AIRFRAME.linear_drag
    assert state[5] == pytest.approx(terminal * (1 - math.exp(-2)), rel=2e-3)
    assert state[3] == pytest.approx(4.0 * (1 - math.exp(-2)), rel=2e-3)


@pytest.mark.parametrize(
    ("stronger", "axis"),
    [((1, 2), 0), ((0, 2), 1), ((0, 1), 2)],  # left rotors: roll right; front: pitch up; ccw: yaw
)
def test_which_way_the_rotors_turn_it(stronger: tuple[int, int], axis: int) -> None:
    state = at_rest(0.0, 0.0, -50.0, 0.0, WEIGHT / 4)
    command = np.full(4, WEIGHT / 4)
    command[list(stronger)] += 0.1
    run(state, command, 0.1)
    assert state[10 + axis] > 0.005
    assert np.abs(np.delete(state[10:13], axis)).max() < 1e-9


def test_mixing_inverts_the_forces() -> None:
    out = np.empty(4)
    torque = np.array([0.2, -0.1, 0.02])
    mix(WEIGHT, torque, AIRFRAME, out)
    f0, f1, f2, f3 = out
    assert out.sum() == pytest.approx(WEIGHT)
    assert AIRFRAME.arm_y * (-f0 + f1 + f2 - f3) == pytest.approx(torque[0])
    assert AIRFRAME.arm_x * (f0 - f1 + f2 - f3) == pytest.approx(torque[1])
    reaction = AIRFRAME.rotor_torque / AIRFRAME.rotor_thrust
    assert reaction * (f0 + f1 - f2 - f3) == pytest.approx(torque[2])


def test_saturated_rotors_keep_roll_before_thrust() -> None:
    out = np.empty(4)
    mix(4 * AIRFRAME.rotor_thrust, np.array([1.0, 0.0, 5.0]), AIRFRAME, out)
    assert out.max() <= AIRFRAME.rotor_thrust + 1e-9
    assert out.min() >= 0
    assert AIRFRAME.arm_y * (-out[0] + out[1] + out[2] - out[3]) == pytest.approx(1.0)


def test_the_ground_stops_levels_and_reports() -> None:
    state = at_rest(0.0, 0.0, -1.0 - AIRFRAME.legs, 0.4, 0.0)
    state[3] = 1.0
    hit = 0.0
    for _ in range(250):
        hit = max(hit, substep(state, OFF, CALM, 0.0, FREE, SUBSTEP))
    assert hit == pytest.approx(math.hypot(1.0, math.sqrt(2 * FREE.gravity)), rel=0.02)
    assert state[2] == -AIRFRAME.legs
    assert not state[3:6].any()
    assert euler_from_quaternion(state[6:10]) == pytest.approx((0.0, 0.0, 0.4), abs=1e-6)


def test_every_number_of_the_airframe_has_a_unit_and_a_source() -> None:
    assert FILE.read_text(encoding="utf-8").count("source = ") == len(AIRFRAME) + len(GAINS)


def test_a_wrong_airframe_names_the_key(tmp_path) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path / "bad.toml"
    text = FILE.read_text(encoding="utf-8")
    file.write_text(text.replace("mass = { value = 1.0", "mass = { value = -1.0"), "utf-8")
    with pytest.raises(ValueError, match=r"airframe\.mass = -1\.0"):
        load(file)
    file.write_text(text.replace("mass =", "maas ="), "utf-8")
    with pytest.raises(ValueError, match="maas, mass"):
        load(file)
