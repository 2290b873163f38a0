"""What is known of a drone: its newest telemetry, and how each message changes it.

Interface: :class:`VehicleState` and :data:`READERS`, pure functions (state, message, now) -> state.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from agent.vehicle.dialects import mavlink

Message = Any


@dataclass(frozen=True)
class VehicleState:
    """The newest telemetry; times are ``time.monotonic()``."""

    heartbeat_at: float = -math.inf
    autopilot: int = mavlink.MAV_AUTOPILOT_INVALID
    armed: bool = False
    custom_mode: int = -1
    position_at: float = -math.inf
    time_boot_ms: int = -1
    position: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # m, NED
    velocity: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # m/s, NED
    attitude: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # rad
    altitude: float = math.nan  # m above the sea
    landed: bool | None = None
    battery: float | None = None  # share
    prearm_ok: bool | None = None  # None: not told
    estimator_ok: bool = True


def _heartbeat(state: VehicleState, message: Message, now: float) -> VehicleState:
    if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
        return state
    return replace(
        state,
        heartbeat_at=now,
        autopilot=message.autopilot,
        armed=bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        custom_mode=message.custom_mode,
    )


def _local_position(state: VehicleState, message: Message, now: float) -> VehicleState:
    return replace(
        state,
        position_at=now,
        time_boot_ms=message.time_boot_ms,
        position=(message.x, message.y, message.z),
        velocity=(message.vx, message.vy, message.vz),
    )


def _attitude(state: VehicleState, message: Message, now: float) -> VehicleState:
    del now
    return replace(state, attitude=(message.roll, message.pitch, message.yaw))


def _global_position(state: VehicleState, message: Message, now: float) -> VehicleState:
    del now
    return replace(state, altitude=message.alt / 1000)


def _extended(state: VehicleState, message: Message, now: float) -> VehicleState:
    del now
    return replace(state, landed=message.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)


def _sys_status(state: VehicleState, message: Message, now: float) -> VehicleState:
    del now
    present = message.onboard_control_sensors_present
    health = message.onboard_control_sensors_health
    prearm, ahrs = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_AHRS
    left = message.battery_remaining
    return replace(
        state,
        battery=left / 100 if left >= 0 else None,
        prearm_ok=bool(health & prearm) or not present & prearm,
        estimator_ok=bool(health & ahrs) or not present & ahrs,
    )


READERS: dict[str, Callable[[VehicleState, Message, float], VehicleState]] = {
    "HEARTBEAT": _heartbeat,
    "LOCAL_POSITION_NED": _local_position,
    "ATTITUDE": _attitude,
    "GLOBAL_POSITION_INT": _global_position,
    "EXTENDED_SYS_STATE": _extended,
    "SYS_STATUS": _sys_status,
}
