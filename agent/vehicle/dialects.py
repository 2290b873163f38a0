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
    takeoff: Mode  # the mode of a take-off that was commanded
    hold: Mode
    land: Mode
    takeoff_above_sea: bool  # what NAV_TAKEOFF's altitude counts from
    stream_first: bool  # set points must flow before the guided mode is entered
    names: dict[Mode, str]
    sticks: frozenset[Mode] = frozenset()  # modes that sink or drift without somebody at the sticks

    def custom_mode(self, mode: Mode) -> int:
        """The number that HEARTBEAT carries in this mode."""
        return mode[0] << 16 | mode[1] << 24 if self.stream_first else mode[0]

    def mode(self, custom_mode: int) -> Mode:
        """The mode that HEARTBEAT tells."""
        if self.stream_first:
            return custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        return custom_mode, 0

    def name_of(self, mode: Mode) -> str:
        """What pilots call a mode."""
        return self.names.get(mode, f"mode {mode[0]}.{mode[1]}")


PX4 = Dialect(
    name="px4",
    before_arming=(4, 3),
    guided=(6, 0),
    takeoff=(4, 2),
    hold=(4, 3),
    land=(4, 6),
    takeoff_above_sea=True,
    stream_first=True,
    names={
        (1, 0): "MANUAL",
        (2, 0): "ALTCTL",
        (3, 0): "POSCTL",
        (4, 2): "AUTO.TAKEOFF",
        (4, 3): "AUTO.LOITER",
        (4, 4): "AUTO.MISSION",
        (4, 5): "AUTO.RTL",
        (4, 6): "AUTO.LAND",
        (5, 0): "ACRO",
        (6, 0): "OFFBOARD",
        (7, 0): "STABILIZED",
    },
    sticks=frozenset({(1, 0), (2, 0), (3, 0), (5, 0), (7, 0)}),
)
ARDUPILOT = Dialect(
    name="ardupilot",
    before_arming=(4, 0),
    guided=(4, 0),
    takeoff=(4, 0),
    hold=(17, 0),
    land=(9, 0),
    takeoff_above_sea=False,
    stream_first=False,
    names={
        (0, 0): "STABILIZE",
        (1, 0): "ACRO",
        (2, 0): "ALT_HOLD",
        (3, 0): "AUTO",
        (4, 0): "GUIDED",
        (5, 0): "LOITER",
        (6, 0): "RTL",
        (7, 0): "CIRCLE",
        (9, 0): "LAND",
        (13, 0): "SPORT",
        (16, 0): "POSHOLD",
        (17, 0): "BRAKE",
        (18, 0): "THROW",
        (21, 0): "SMART_RTL",
    },
    sticks=frozenset({(0, 0), (1, 0), (2, 0), (13, 0)}),
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
