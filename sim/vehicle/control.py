"""Cascaded control: position -> velocity -> acceleration -> attitude -> rates -> rotors.

Target (8,): position NED (0:3) [m], velocity NED (3:6) [m/s], yaw [rad], yaw rate [rad/s]; NaN
where nothing is asked.  An axis with a position flies there, its velocity is then fed forward; an
axis with a velocity alone flies at it; with neither it stops.  Without a yaw the heading is kept,
with a yaw rate it turns.

Memory (4,): integral of the velocity error as an acceleration NED (0:3) [m/s^2], wanted heading
(3) [rad].

Source: T. Lee, M. Leok, N. H. McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)",
CDC 2010, for the attitude from a thrust vector; the order of loops and limits is PX4's.
"""

from typing import NamedTuple

import numpy as np

from sim.vehicle.airframe import Airframe, Gains
from sim.vehicle.compiled import compiled
from sim.vehicle.dynamics import SUBSTEP, substep
from sim.vehicle.frames import Doubles, euler_from_quaternion, multiply, rotate, wrap

MEMORY = 4
TARGET = 8


class Speeds(NamedTuple):
    """What the vehicle may do [m/s]."""

    horizontal: float
    up: float
    down: float


@compiled
def approach(error: float, gain: float, brake: float) -> float:
    """Speed towards something `error` metres away: linear near it, braking evenly from afar."""
    near = brake / (gain * gain)
    if abs(error) <= near:
        return gain * error
    speed: float = np.sqrt(2 * brake * abs(error) - brake * near)
    return speed if error > 0 else -speed


@compiled
def wanted_velocity(
    state: Doubles, target: Doubles, gains: Gains, speeds: Speeds, out: Doubles
) -> None:
    """The velocity NED (3,) that the target asks for now, within the limits."""
    dx, dy = target[0] - state[0], target[1] - state[1]
    out[0] = 0.0 if np.isnan(target[3]) else target[3]
    out[1] = 0.0 if np.isnan(target[4]) else target[4]
    out[2] = 0.0 if np.isnan(target[5]) else target[5]
    if not np.isnan(dx) and not np.isnan(dy):  # straight to the point, not axis by axis
        distance = np.sqrt(dx * dx + dy * dy)
        if distance > 1e-9:
            speed = min(approach(distance, gains.position, gains.brake), speeds.horizontal)
            out[0] += speed * dx / distance
            out[1] += speed * dy / distance
    elif not np.isnan(dx):
        out[0] += approach(dx, gains.position, gains.brake)
    elif not np.isnan(dy):
        out[1] += approach(dy, gains.position, gains.brake)
    if not np.isnan(target[2]):
        out[2] += approach(target[2] - state[2], gains.position, gains.brake)
    fast = np.sqrt(out[0] ** 2 + out[1] ** 2)
    if fast > speeds.horizontal:
        out[0] *= speeds.horizontal / fast
        out[1] *= speeds.horizontal / fast
    out[2] = min(speeds.down, max(-speeds.up, out[2]))


@compiled
def wanted_acceleration(
    state: Doubles, velocity: Doubles, memory: Doubles, gains: Gains, dt: float, out: Doubles
) -> None:
    """The acceleration NED (3,) that brings the velocity there; integrates unless saturated."""
    for i in range(3):
        error = velocity[i] - state[3 + i]
        out[i] = gains.velocity * error + memory[i]
        limit = gains.acceleration
        if abs(out[i]) < limit or out[i] * error < 0:
            memory[i] += gains.velocity_integral * error * dt
            memory[i] = min(limit, max(-limit, memory[i]))
    size = np.sqrt(out[0] ** 2 + out[1] ** 2)
    if size > gains.acceleration:
        out[0] *= gains.acceleration / size
        out[1] *= gains.acceleration / size
    out[2] = min(gains.acceleration, max(-gains.acceleration, out[2]))


@compiled
def attitude_from_thrust(force: Doubles, yaw: float, out: Doubles) -> None:
    """world_from_body (4,) whose -z points along `force` (3,) and whose nose is nearest to yaw."""
    size = np.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    zx, zy, zz = -force[0] / size, -force[1] / size, -force[2] / size
    # y = z x (heading), then x = y x z
    hx, hy = np.cos(yaw), np.sin(yaw)
    yx, yy, yz = -zz * hy, zz * hx, zx * hy - zy * hx
    norm = np.sqrt(yx * yx + yy * yy + yz * yz)
    yx, yy, yz = yx / norm, yy / norm, yz / norm
    xx, xy, xz = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    trace = xx + yy + zz
    if trace > 0.0:
        s = 2.0 * np.sqrt(trace + 1.0)
        out[0], out[1], out[2], out[3] = 0.25 * s, (yz - zy) / s, (zx - xz) / s, (xy - yx) / s
    elif xx >= yy and xx >= zz:
        s = 2.0 * np.sqrt(1.0 + xx - yy - zz)
        out[0], out[1], out[2], out[3] = (yz - zy) / s, 0.25 * s, (yx + xy) / s, (zx + xz) / s
    elif yy >= zz:
        s = 2.0 * np.sqrt(1.0 + yy - xx - zz)
        out[0], out[1], out[2], out[3] = (zx - xz) / s, (yx + xy) / s, 0.25 * s, (zy + yz) / s
    else:
        s = 2.0 * np.sqrt(1.0 + zz - xx - yy)
        out[0], out[1], out[2], out[3] = (xy - yx) / s, (zx + xz) / s, (zy + yz) / s, 0.25 * s


@compiled
def mix(thrust: float, torque: Doubles, airframe: Airframe, out: Doubles) -> None:
    """Rotor thrusts (4,) of a collective thrust [N] and a torque FRD (3,) [N m].

    Where they do not fit, yaw gives way first, then the collective thrust; roll and pitch last.
    """
    a = airframe
    x = torque[0] / (4 * a.arm_y)
    y = torque[1] / (4 * a.arm_x)
    z = torque[2] * a.rotor_thrust / (4 * a.rotor_torque)
    limit = 0.15 * a.rotor_thrust  # a guess: what yaw may take of a rotor
    z = min(limit, max(-limit, z))
    base = thrust / 4
    out[0] = -x + y + z
    out[1] = x - y + z
    out[2] = x + y - z
    out[3] = -x - y - z
    highest = max(out[0], out[1], out[2], out[3])
    lowest = min(out[0], out[1], out[2], out[3])
    if highest - lowest > a.rotor_thrust:
        for i in range(4):
            out[i] *= a.rotor_thrust / (highest - lowest)
        highest *= a.rotor_thrust / (highest - lowest)
    base = min(base, a.rotor_thrust - highest)
    for i in range(4):
        out[i] = min(a.rotor_thrust, max(0.0, base + out[i]))


@compiled
def command(
    state: Doubles,
    target: Doubles,
    memory: Doubles,
    airframe: Airframe,
    gains: Gains,
    speeds: Speeds,
    dt: float,
    out: Doubles,
) -> None:
    """Rotor thrusts (4,) [N] for the target, from the state that the autopilot believes in."""
    velocity, acceleration = np.empty(3), np.empty(3)
    wanted_velocity(state, target, gains, speeds, velocity)
    wanted_acceleration(state, velocity, memory, gains, dt, acceleration)

    # force, tilted by at most the limit
    a = airframe
    force = np.empty(3)
    force[2] = a.mass * (acceleration[2] - a.gravity)
    force[2] = min(-0.2 * a.mass * a.gravity, max(-3.8 * a.rotor_thrust, force[2]))
    reach = -force[2] * np.tan(gains.tilt)
    fx, fy = a.mass * acceleration[0], a.mass * acceleration[1]
    size = np.sqrt(fx * fx + fy * fy)
    scale = reach / size if size > reach else 1.0
    force[0], force[1] = fx * scale, fy * scale

    # heading
    yaw = euler_from_quaternion(state[6:10])[2]
    feed = 0.0
    if not np.isnan(target[6]):
        memory[3] = target[6]
    elif not np.isnan(target[7]):
        feed = min(gains.turn_rate, max(-gains.turn_rate, target[7]))
        ahead = wrap(memory[3] + feed * dt - yaw)
        memory[3] = wrap(yaw + min(0.5, max(-0.5, ahead)))

    # attitude -> rates.  The thrust direction has the roll and pitch gain, the heading its own.
    wanted, inverse, error = np.empty(4), np.empty(4), np.empty(4)
    attitude_from_thrust(force, yaw, wanted)
    inverse[0], inverse[1], inverse[2], inverse[3] = state[6], -state[7], -state[8], -state[9]
    multiply(inverse, wanted, error)
    sign = 2.0 if error[0] >= 0 else -2.0
    turning = feed + gains.heading * wrap(memory[3] - yaw)
    turning = min(gains.turn_rate, max(-gains.turn_rate, turning))
    torque = np.empty(3)
    torque[0] = a.inertia_x * gains.rate * (gains.attitude * sign * error[1] - state[10])
    torque[1] = a.inertia_y * gains.rate * (gains.attitude * sign * error[2] - state[11])
    torque[2] = a.inertia_z * gains.rate_yaw * (turning - state[12])

    # thrust along the axis that the body has now
    down, axis = np.zeros(3), np.empty(3)
    down[2] = 1.0
    rotate(state[6:10], down, axis)
    thrust = -(force[0] * axis[0] + force[1] * axis[1] + force[2] * axis[2])
    mix(max(0.0, thrust), torque, a, out)


@compiled
def fly(
    state: Doubles,
    target: Doubles,
    memory: Doubles,
    belief: Doubles,
    wind: Doubles,
    ground: float,
    airframe: Airframe,
    gains: Gains,
    speeds: Speeds,
    substeps: int,
) -> float:
    """Advance `state` and `memory` in place under control; return the hardest impact [m/s].

    `belief` (7,) is what the sensors add to position, velocity and yaw: the control flies by what
    it believes, not by the truth.
    """
    hardest = 0.0
    rotors, sensed = np.empty(4), np.empty(17)
    aim = target.copy()
    aim[6] = target[6] - belief[6]
    for _ in range(substeps):
        sensed[:] = state
        for i in range(6):
            sensed[i] += belief[i]
        command(sensed, aim, memory, airframe, gains, speeds, SUBSTEP, rotors)
        hardest = max(hardest, substep(state, rotors, wind, ground, airframe, SUBSTEP))
    return hardest


@compiled
def coast(state: Doubles, wind: Doubles, ground: float, airframe: Airframe, substeps: int) -> float:
    """Advance `state` in place with the rotors off; return the hardest impact [m/s]."""
    hardest = 0.0
    rotors = np.zeros(4)
    for _ in range(substeps):
        hardest = max(hardest, substep(state, rotors, wind, ground, airframe, SUBSTEP))
    return hardest
