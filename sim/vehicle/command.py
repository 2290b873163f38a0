"""One command, from either message, and what it takes to refuse it.

Interface: :class:`Command`, :func:`read`, :class:`Refusal`, :func:`require`, :func:`place_of`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim.vehicle import setpoints
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.frames import Doubles, Geodetic, ned_from_geodetic
from sim.vehicle.setpoints import ABOVE_HOME, ABOVE_SEA

if TYPE_CHECKING:
    from sim.vehicle.autopilot import Autopilot

DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED_FRAME = 9  # MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME, missing from pymavlink
FAR_INT = 0x7FFFFFFF  # COMMAND_INT's "no value" for a coordinate


class Refusal(Exception):  # noqa: N818  (an answer, not an error)
    """The command is not carried out; the result says what to answer."""

    def __init__(self, result: int, reason: str = "") -> None:
        super().__init__(reason)
        self.result = result


@dataclass(frozen=True)
class Command:
    """One command, from either message."""

    id: int
    params: tuple[float, float, float, float]
    x: float  # latitude [deg] or param5; NaN: none
    y: float  # longitude [deg] or param6; NaN: none
    z: float  # altitude [m] or param7
    frame: int
    sender: tuple[int, int]

    def whole(self, index: int) -> int:
        """A parameter (1 to 4) as an integer."""
        value = self.params[index - 1]
        if not math.isfinite(value):
            raise Refusal(DENIED)
        return int(value)


def read(message: Message) -> Command:
    """The command of a message."""
    params = (message.param1, message.param2, message.param3, message.param4)
    sender = (message.get_srcSystem(), message.get_srcComponent())
    if message.get_type() == "COMMAND_LONG":
        frame = mavlink.MAV_FRAME_GLOBAL
        x, y, z = message.param5, message.param6, message.param7
    else:
        frame = message.frame
        x = math.nan if message.x == FAR_INT else message.x * 1e-7
        y = math.nan if message.y == FAR_INT else message.y * 1e-7
        z = message.z
    return Command(message.command, params, x, y, z, frame, sender)


def require(pilot: Autopilot, reason: str | None) -> None:
    """Refuse as the flavour does, if there is a reason."""
    if reason is not None:
        raise Refusal(pilot.flavour.refusal, reason)


def place_of(pilot: Autopilot, frame: int, latitude: float, longitude: float, z: float) -> Doubles:
    """A place (3,) [m, NED]; what is NaN stays as it is."""
    here = pilot.body.position
    if frame in ABOVE_SEA:
        base = 0.0
    elif frame in ABOVE_HOME:
        base = pilot.home.altitude
    else:
        raise Refusal(UNSUPPORTED_FRAME)
    place = here.copy()
    if math.isfinite(latitude) and math.isfinite(longitude):
        if abs(latitude) > 90 or abs(longitude) > 180:
            raise Refusal(DENIED)
        target = Geodetic(latitude, longitude, 0.0)
        place[0], place[1], _ = ned_from_geodetic(pilot.origin, target)
    if math.isfinite(z):
        place[2] = pilot.origin.altitude - (z + base)
    if not np.all(np.abs(place) < setpoints.FARTHEST):
        raise Refusal(DENIED)
    return place
