"""What PX4 and ArduPilot do differently, as far as the other end of a link can see it.

:data:`PX4` and :data:`ARDUPILOT` are the two tables; where the difference is behaviour rather than
a number, the code that decides asks ``flavour.px4``.  Sources: PX4 v1.17
``src/modules/commander/px4_custom_mode.h``, ArduPilot 4.7 ``ArduCopter/mode.h``.
"""

from dataclasses import dataclass
from enum import Enum

from sim.vehicle.dialect import mavlink


class Mode(Enum):
    """What the autopilot is doing."""

    MANUAL = "manual"  # waits on the ground; in the air it holds, since nobody has the sticks
    HOLD = "hold"
    GUIDED = "guided"  # PX4: OFFBOARD
    TAKEOFF = "takeoff"
    MISSION = "mission"
    RETURN = "return"
    LAND = "land"


@dataclass(frozen=True)
class Flavour:
    """The numbers of one autopilot."""

    name: str
    autopilot: int  # MAV_AUTOPILOT
    version: int  # flight_sw_version: major, minor, patch, type (255 = release)
    capabilities: int  # MAV_PROTOCOL_CAPABILITY
    modes: dict[int, Mode]  # custom_mode -> mode; the first of a mode is what it reports
    first_mode: Mode
    refusal: int  # MAV_RESULT of a command that the state forbids
    force_arm: frozenset[int]  # param2 of COMPONENT_ARM_DISARM that arms without checks
    setpoint_timeout: str  # parameter
    estimator_seconds: float  # s after the start until the estimator has a position
    streams_at_start: bool  # whether telemetry flows before anybody asks

    @property
    def px4(self) -> bool:
        return bool(self.autopilot == mavlink.MAV_AUTOPILOT_PX4)

    def mode(self, custom_mode: int) -> Mode | None:
        """The mode behind a number, None if there is none."""
        return self.modes.get(custom_mode)

    def custom_mode(self, mode: Mode) -> int:
        """The number that HEARTBEAT carries."""
        return next(number for number, known in self.modes.items() if known is mode)


def px4_mode(main: int, sub: int = 0) -> int:
    """PX4's custom_mode: main mode in bits 16 to 23, sub mode in bits 24 to 31."""
    return main << 16 | sub << 24


POSITION_CONTROL = px4_mode(3)  # POSCTL

_COMMON_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)

PX4 = Flavour(
    name="px4",
    autopilot=mavlink.MAV_AUTOPILOT_PX4,
    version=1 << 24 | 17 << 16 | 0 << 8 | 255,
    capabilities=_COMMON_CAPABILITIES | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
    modes={
        px4_mode(4, 3): Mode.HOLD,
        px4_mode(1): Mode.MANUAL,
        px4_mode(2): Mode.HOLD,  # altitude and position control: nobody has the sticks
        POSITION_CONTROL: Mode.HOLD,
        px4_mode(6): Mode.GUIDED,
        px4_mode(4, 2): Mode.TAKEOFF,
        px4_mode(4, 4): Mode.MISSION,
        px4_mode(4, 5): Mode.RETURN,
        px4_mode(4, 6): Mode.LAND,
        px4_mode(4, 9): Mode.LAND,  # precision landing
        px4_mode(7): Mode.MANUAL,  # STABILIZED
    },
    first_mode=Mode.HOLD,
    refusal=mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
    force_arm=frozenset({21196}),
    setpoint_timeout="COM_OF_LOSS_T",
    estimator_seconds=2.0,
    streams_at_start=True,
)

ARDUPILOT = Flavour(
    name="ardupilot",
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    version=4 << 24 | 7 << 16 | 0 << 8 | 255,
    capabilities=_COMMON_CAPABILITIES
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
    modes={
        0: Mode.MANUAL,  # STABILIZE
        2: Mode.MANUAL,  # ALT_HOLD
        3: Mode.MISSION,  # AUTO
        4: Mode.GUIDED,
        5: Mode.HOLD,  # LOITER
        6: Mode.RETURN,  # RTL
        9: Mode.LAND,
        16: Mode.HOLD,  # POSHOLD
        17: Mode.HOLD,  # BRAKE
        21: Mode.RETURN,  # SMART_RTL
    },
    first_mode=Mode.MANUAL,
    refusal=mavlink.MAV_RESULT_FAILED,
    force_arm=frozenset({2989, 21196}),
    setpoint_timeout="GUID_TIMEOUT",
    estimator_seconds=5.0,  # the real one takes 20 to 40 s
    streams_at_start=False,
)

FLAVOURS = {flavour.name: flavour for flavour in (PX4, ARDUPILOT)}
