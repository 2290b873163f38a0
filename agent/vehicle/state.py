"""What is known of a drone: its newest telemetry, and how each message changes it.

Interface: :class:`VehicleState` and :data:`READERS`, pure functions (state, message, now) -> state.
What a message reports is checked before it is kept: numbers that are none leave what was known
before, which then grows old; ``unusable`` says what came instead.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from agent.vehicle.dialects import mavlink

Message = Any

FARTHEST = 1e6  # m, m/s or rad; beyond it a number is nonsense
JUMP = 2.0  # m; what a position may be off from where the last one led
FASTEST = 20.0  # m/s; what no drone of ours flies
RESTART = 1000  # ms that the clock of an autopilot falls back when it has restarted


@dataclass(frozen=True)
class VehicleState:
    """The newest telemetry; times are ``time.monotonic()``."""

    heartbeat_at: float = -math.inf
    autopilot: int = mavlink.MAV_AUTOPILOT_INVALID
    armed: bool = False
    custom_mode: int = -1
    failsafe: bool = False  # MAV_STATE_CRITICAL: the autopilot, not a person, chose the mode
    position_at: float = -math.inf
    time_boot_ms: int = -1
    restarts: int = 0  # of the autopilot since we talk to it
    position: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # m, NED
    velocity: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # m/s, NED
    jump: float = 0.0  # m, of the estimate of the position, when it jumped last
    jumped_at: float = -math.inf
    attitude_at: float = -math.inf
    attitude: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # rad
    unusable: str = ""  # the last number that was none, and where it stood
    altitude: float = math.nan  # m above the sea
    home: tuple[float, float, float] | None = None  # m, NED: where the autopilot has its home
    landed: bool | None = None
    battery: float | None = None  # share
    prearm_ok: bool | None = None  # None: not told
    estimator_ok: bool = True


def _nonsense(message: Message, *names: str) -> str:
    """The first field that is no usable number, as a person reads it; empty where all are."""
    for name in names:
        value = getattr(message, name)
        if not abs(value) <= FARTHEST:  # also where it is NaN
            return f"{message.get_type()}.{name} = {value}"
    return ""


def _heartbeat(state: VehicleState, message: Message, now: float) -> VehicleState:
    if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
        return state
    return replace(
        state,
        heartbeat_at=now,
        autopilot=message.autopilot,
        armed=bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        custom_mode=message.custom_mode,
        failsafe=message.system_status in {mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY},
    )


def _local_position(state: VehicleState, message: Message, now: float) -> VehicleState:
    if nonsense := _nonsense(message, "x", "y", "z", "vx", "vy", "vz"):
        return replace(state, unusable=nonsense)
    place = (message.x, message.y, message.z)
    restarted = message.time_boot_ms < state.time_boot_ms - RESTART
    jump = 0.0 if restarted else _jump(state, place, message.time_boot_ms)
    return replace(
        state,
        position_at=now,
        time_boot_ms=message.time_boot_ms,
        restarts=state.restarts + restarted,
        position=place,
        velocity=(message.vx, message.vy, message.vz),
        jump=jump or state.jump,
        jumped_at=now if jump else state.jumped_at,
    )


def _jump(state: VehicleState, place: tuple[float, float, float], ms: int) -> float:
    """How far [m] the estimate has jumped, beyond what any drone flies; 0 where it has not."""
    way = math.dist(state.position, place)
    passed = max(ms - state.time_boot_ms, 0) / 1000
    return way if way > JUMP + FASTEST * passed else 0.0  # NaN at first: no jump


def _attitude(state: VehicleState, message: Message, now: float) -> VehicleState:
    if nonsense := _nonsense(message, "roll", "pitch", "yaw"):
        return replace(state, unusable=nonsense)
    return replace(state, attitude_at=now, attitude=(message.roll, message.pitch, message.yaw))


def _global_position(state: VehicleState, message: Message, now: float) -> VehicleState:
    del now
    return replace(state, altitude=message.alt / 1000)


def _home(state: VehicleState, message: Message, now: float) -> VehicleState:
    del now
    if nonsense := _nonsense(message, "x", "y", "z"):
        return replace(state, unusable=nonsense)
    return replace(state, home=(message.x, message.y, message.z))


def _extended(state: VehicleState, message: Message, now: float) -> VehicleState:
    del now
    return replace(state, landed=message.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)


def _sys_status(state: VehicleState, message: Message, now: float) -> VehicleState:
    """PX4 sets the prearm bit in ``health`` alone, ArduPilot in ``present`` as well."""
    del now
    present = message.onboard_control_sensors_present
    health = message.onboard_control_sensors_health
    prearm, ahrs = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_AHRS
    told = present & prearm or state.autopilot == mavlink.MAV_AUTOPILOT_PX4
    left = message.battery_remaining
    return replace(
        state,
        battery=left / 100 if 0 <= left <= 100 else None,
        prearm_ok=bool(health & prearm) or not told,
        estimator_ok=bool(health & ahrs) or not present & ahrs,
    )


READERS: dict[str, Callable[[VehicleState, Message, float], VehicleState]] = {
    "HEARTBEAT": _heartbeat,
    "LOCAL_POSITION_NED": _local_position,
    "ATTITUDE": _attitude,
    "GLOBAL_POSITION_INT": _global_position,
    "HOME_POSITION": _home,
    "EXTENDED_SYS_STATE": _extended,
    "SYS_STATUS": _sys_status,
}
