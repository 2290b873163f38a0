"""Frames and rotations.

World: NED, x north, y east, z down [m], origin at the place of take-off.  Body: FRD, x forward,
y right, z down.  Quaternions are (w, x, y, z), Hamilton's product, unit length, and turn body
vectors into world vectors (``world_from_body``).  Euler angles: roll, pitch, yaw [rad], applied as
yaw, pitch, roll (z-y'-x''); yaw is clockwise from north seen from above.

Source of the ellipsoid: NIMA TR8350.2, "World Geodetic System 1984", 3rd edition.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.vehicle.compiled import compiled

Doubles = NDArray[np.float64]

EQUATOR_RADIUS = 6_378_137.0  # m, WGS 84 semi-major axis
FLATTENING = 1 / 298.257223563  # WGS 84
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)


class Geodetic(NamedTuple):
    """A place on Earth."""

    latitude: float  # deg
    longitude: float  # deg
    altitude: float  # m above mean sea level (taken as the ellipsoid)


def _radii(latitude: float) -> tuple[float, float]:
    """Metres per radian of latitude and of longitude."""
    sine = math.sin(math.radians(latitude))
    shrink = 1 - ECCENTRICITY_SQUARED * sine * sine
    north = EQUATOR_RADIUS * (1 - ECCENTRICITY_SQUARED) / shrink**1.5
    east = EQUATOR_RADIUS / math.sqrt(shrink) * math.cos(math.radians(latitude))
    return north, east


def geodetic_from_ned(origin: Geodetic, north: float, east: float, down: float) -> Geodetic:
    """The place at an offset from the origin; good to 1 cm within 1 km."""
    per_latitude, per_longitude = _radii(origin.latitude)
    return Geodetic(
        origin.latitude + math.degrees(north / per_latitude),
        origin.longitude + math.degrees(east / per_longitude),
        origin.altitude - down,
    )


def ned_from_geodetic(origin: Geodetic, place: Geodetic) -> tuple[float, float, float]:
    """The inverse of :func:`geodetic_from_ned`."""
    per_latitude, per_longitude = _radii(origin.latitude)
    turn = (place.longitude - origin.longitude + 180.0) % 360.0 - 180.0
    return (
        math.radians(place.latitude - origin.latitude) * per_latitude,
        math.radians(turn) * per_longitude,
        origin.altitude - place.altitude,
    )


def enu_from_ned(ned: tuple[float, float, float]) -> tuple[float, float, float]:
    """East, north, up from north, east, down.  Its own inverse."""
    return ned[1], ned[0], -ned[2]


def ned_from_heading(yaw: float, forward: float, right: float) -> tuple[float, float]:
    """North and east of a horizontal vector that is given along the nose."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return cosine * forward - sine * right, sine * forward + cosine * right


@compiled
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@compiled
def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Doubles:
    """world_from_body (4,) of an attitude [rad]."""
    cr, sr = np.cos(roll / 2), np.sin(roll / 2)
    cp, sp = np.cos(pitch / 2), np.sin(pitch / 2)
    cy, sy = np.cos(yaw / 2), np.sin(yaw / 2)
    out = np.empty(4)
    out[0] = cr * cp * cy + sr * sp * sy
    out[1] = sr * cp * cy - cr * sp * sy
    out[2] = cr * sp * cy + sr * cp * sy
    out[3] = cr * cp * sy - sr * sp * cy
    return out


@compiled
def euler_from_quaternion(q: Doubles) -> tuple[float, float, float]:
    """Roll, pitch, yaw [rad] of world_from_body (4,)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(min(1.0, max(-1.0, 2 * (w * y - z * x))))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


@compiled
def multiply(p: Doubles, q: Doubles, out: Doubles) -> None:
    """Hamilton's product p q (4,)."""
    w = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    x = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    y = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    z = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


@compiled
def rotate(q: Doubles, v: Doubles, out: Doubles) -> None:
    """World vector (3,) of the body vector `v` (3,)."""
    tx = 2 * (q[2] * v[2] - q[3] * v[1])
    ty = 2 * (q[3] * v[0] - q[1] * v[2])
    tz = 2 * (q[1] * v[1] - q[2] * v[0])
    x = v[0] + q[0] * tx + q[2] * tz - q[3] * ty
    y = v[1] + q[0] * ty + q[3] * tx - q[1] * tz
    z = v[2] + q[0] * tz + q[1] * ty - q[2] * tx
    out[0], out[1], out[2] = x, y, z


@compiled
def turn(q: Doubles, rate: Doubles, seconds: float) -> None:
    """Turn `q` (4,) in place by a constant body rate (3,) [rad/s]: exact, stays a unit."""
    speed = np.sqrt(rate[0] ** 2 + rate[1] ** 2 + rate[2] ** 2)
    half = 0.5 * speed * seconds
    scale = 0.5 * seconds if speed < 1e-9 else np.sin(half) / speed
    step = np.empty(4)
    step[0] = np.cos(half)
    step[1], step[2], step[3] = rate[0] * scale, rate[1] * scale, rate[2] * scale
    multiply(q, step, q)
    norm = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    for i in range(4):
        q[i] /= norm
