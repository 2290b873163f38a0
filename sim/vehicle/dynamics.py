"""The rigid body: one substep of 4 ms of a quadrotor X with lagging rotors, drag and wind.

State (17,): position NED (0:3) [m], velocity NED (3:6) [m/s], world_from_body quaternion w, x, y, z
(6:10), body rates FRD (10:13) [rad/s], rotor thrusts (13:17) [N].  Rotors as PX4 numbers them:
front right, rear left (both turn counter-clockwise), front left, rear right (clockwise).

Position and velocity are integrated exactly for a constant acceleration, the attitude exactly for a
constant rate, the rotors exactly for a constant command; the body rates by an Euler step.
The ground is a plane: the legs stand on it, do not slide, and level the body.
"""

import numpy as np

from sim.vehicle.airframe import Airframe
from sim.vehicle.compiled import compiled
from sim.vehicle.frames import Doubles, euler_from_quaternion, quaternion_from_euler, rotate, turn

SUBSTEP = 1 / 250  # s
STATE = 17


def at_rest(x: float, y: float, z: float, yaw: float, rotor: float) -> Doubles:
    """A level state that does not move; `rotor` is the thrust of each rotor [N]."""
    state = np.zeros(STATE)
    state[0:3] = x, y, z
    state[6:10] = quaternion_from_euler(0.0, 0.0, yaw)
    state[13:17] = rotor
    return state


def energy(state: Doubles, airframe: Airframe) -> float:
    """Kinetic and potential energy [J]; potential energy is zero at z = 0."""
    inertia = np.array([airframe.inertia_x, airframe.inertia_y, airframe.inertia_z])
    velocity, rate = state[3:6], state[10:13]
    moving = 0.5 * airframe.mass * (velocity @ velocity) + 0.5 * (inertia * rate) @ rate
    return float(moving - airframe.mass * airframe.gravity * state[2])


@compiled
def substep(
    state: Doubles, command: Doubles, wind: Doubles, ground: float, airframe: Airframe, dt: float
) -> float:
    """Advance `state` in place; return the speed of an impact on the ground [m/s], else 0.

    Args:
        state: see the module.
        command: (4,) thrust wanted of each rotor [N].
        wind: (3,) velocity of the air, NED [m/s].
        ground: z of the ground [m].
        airframe: its parameters.
        dt: seconds.
    """
    a = airframe
    blend = 1.0 - np.exp(-dt / a.rotor_lag)
    for i in range(4):
        wanted = min(a.rotor_thrust, max(0.0, command[i]))
        state[13 + i] += blend * (wanted - state[13 + i])
    f0, f1, f2, f3 = state[13], state[14], state[15], state[16]

    # forces: thrust along -z of the body, drag against the air, weight
    push = np.zeros(3)
    push[2] = -(f0 + f1 + f2 + f3)
    force = np.empty(3)
    rotate(state[6:10], push, force)
    acceleration = np.empty(3)
    for i in range(3):
        drag = a.linear_drag * (wind[i] - state[3 + i])
        acceleration[i] = (force[i] + drag) / a.mass
    acceleration[2] += a.gravity

    # torques: arms, reaction of the rotors, drag; Euler's equation
    p, q, r = state[10], state[11], state[12]
    reaction = a.rotor_torque / a.rotor_thrust
    torque_x = a.arm_y * (-f0 + f1 + f2 - f3) - a.angular_drag * p
    torque_y = a.arm_x * (f0 - f1 + f2 - f3) - a.angular_drag * q
    torque_z = reaction * (f0 + f1 - f2 - f3) - a.angular_drag * r
    state[10] += dt * (torque_x - (a.inertia_z - a.inertia_y) * q * r) / a.inertia_x
    state[11] += dt * (torque_y - (a.inertia_x - a.inertia_z) * r * p) / a.inertia_y
    state[12] += dt * (torque_z - (a.inertia_y - a.inertia_x) * p * q) / a.inertia_z

    turn(state[6:10], state[10:13], dt)
    for i in range(3):
        state[i] += dt * (state[3 + i] + 0.5 * dt * acceleration[i])
        state[3 + i] += dt * acceleration[i]

    floor = ground - a.legs
    if state[2] < floor:
        return 0.0
    impact: float = np.sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2)
    settle(state, floor)
    return impact


@compiled
def settle(state: Doubles, floor: float) -> None:
    """Stand on the legs: level, at rest, the heading kept."""
    state[2] = floor
    state[3:6] = 0.0
    state[10:13] = 0.0
    yaw = euler_from_quaternion(state[6:10])[2]
    state[6:10] = quaternion_from_euler(0.0, 0.0, yaw)
