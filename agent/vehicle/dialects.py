"""What PX4 and ArduPilot want differently from whoever flies them.

PX4: arm in HOLD, take off to an altitude above the sea, stream set points, then enter OFFBOARD.
ArduPilot: enter GUIDED, arm, take off to a height above home, then stream; it sends no telemetry
until asked, and to stand still it wants BRAKE, since LOITER follows the sticks.

Sources: docs.px4.io/main/en/flight_modes/offboard.html, ardupilot.org/dev/docs/
copter-commands-in-guided-mode.html.
"""

import os
from dataclasses import dataclass

os.environ.setdefault("MAVLINK20", "1")  # pymavlink reads it when it is imported

from pymavlink.dialects.v20 import common as mavlink

from agent.errors import VehicleError

__all__ = ["ARDUPILOT", "PX4", "Dialect", "Mode", "dialect_of", "mavlink"]

Mode = tuple[int, int]  # param2 and param3 of DO_SET_MODE


@dataclass(frozen=True)
class Dialect:
    """One autopilot's habits."""

    name: str
    before_arming: Mode  # the mode to arm in
    guided: Mode  # the mode that obeys set points
    hold: Mode
    land: Mode
    takeoff_above_sea: bool  # what NAV_TAKEOFF's altitude counts from
    stream_first: bool  # set points must flow before the guided mode is entered

    def custom_mode(self, mode: Mode) -> int:
        """The number that HEARTBEAT carries in this mode."""
        return mode[0] << 16 | mode[1] << 24 if self.stream_first else mode[0]


PX4 = Dialect(
    name="px4",
    before_arming=(4, 3),
    guided=(6, 0),
    hold=(4, 3),
    land=(4, 6),
    takeoff_above_sea=True,
    stream_first=True,
)
ARDUPILOT = Dialect(
    name="ardupilot",
    before_arming=(4, 0),
    guided=(4, 0),
    hold=(17, 0),
    land=(9, 0),
    takeoff_above_sea=False,
    stream_first=False,
)


def dialect_of(autopilot: int) -> Dialect:
    """The dialect for HEARTBEAT.autopilot.

    Raises:
        VehicleError: nobody here speaks it.
    """
    if autopilot == mavlink.MAV_AUTOPILOT_PX4:
        return PX4
    if autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return ARDUPILOT
    raise VehicleError(f"autopilot {autopilot} is not known: expected PX4 (12) or ArduPilot (3)")
