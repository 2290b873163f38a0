"""What a vehicle says about itself: one builder per message, and when each is due.

Interface: :func:`build` (a message by its number) and :class:`Streams` (intervals, due times).
Units are those of the MAVLink common message set.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from sim.vehicle.codec import Attitude, LocalPosition
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import Flavour, Mode
from sim.vehicle.frames import Doubles, Geodetic, geodetic_from_ned

SHORTEST = 0.001  # s; what is faster than a slice of time goes out once a slice
CELLS, FULL, EMPTY = 3, 4.2, 3.5  # a lithium pack: cells, V per cell; guesses of the right size
HOVER_CURRENT = 12.0  # A, a guess
BOOT_TIME = 1_767_225_600  # s, 2026-01-01: SYSTEM_TIME runs on simulation time from here

_SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_GEOFENCE
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)


@dataclass(frozen=True)
class View:
    """Everything that telemetry is made of, at one moment."""

    flavour: Flavour
    now: float  # s since boot
    armed: bool
    mode: Mode
    custom_mode: int
    landed_state: int  # MAV_LANDED_STATE
    position: Doubles  # (3,) [m, NED]
    velocity: Doubles  # (3,) [m/s, NED]
    attitude: tuple[float, float, float]  # roll, pitch, yaw [rad]
    rates: Doubles  # (3,) [rad/s, FRD]
    thrust: float  # share
    origin: Geodetic
    home: Geodetic
    home_ned: Doubles  # (3,) [m]
    battery: float  # share that is left
    estimator: bool  # whether it has a position
    armable: bool
    failsafe: bool
    system: int

    @property
    def ms(self) -> int:
        return round(self.now * 1000)

    @property
    def place(self) -> Geodetic:
        return geodetic_from_ned(self.origin, *self.position)

    @property
    def heading(self) -> float:
        """Degrees, 0 to 360."""
        return math.degrees(self.attitude[2]) % 360.0


def local_position(view: View) -> LocalPosition:
    """LOCAL_POSITION_NED."""
    return LocalPosition(view.ms, *view.position, *view.velocity)


def attitude(view: View) -> Attitude:
    """ATTITUDE."""
    roll, pitch, yaw = view.attitude
    yaw = (yaw + math.pi) % (2 * math.pi) - math.pi
    return Attitude(view.ms, roll, pitch, yaw, *view.rates)


def heartbeat(view: View) -> Message:
    """HEARTBEAT."""
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    if view.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    if view.mode is not Mode.MANUAL:
        base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED | mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    if not view.estimator:
        status = mavlink.MAV_STATE_CALIBRATING
    elif view.failsafe:
        status = mavlink.MAV_STATE_CRITICAL
    else:
        status = mavlink.MAV_STATE_ACTIVE if view.armed else mavlink.MAV_STATE_STANDBY
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR,
        view.flavour.autopilot,
        base,
        view.custom_mode,
        status,
        3,
    )


def _sys_status(view: View) -> Message:
    health = present = _SENSORS
    if view.flavour.px4:
        present &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK  # it is only ever in health
    if not view.armable and not view.armed:
        health &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    if not view.estimator:
        health &= ~(mavlink.MAV_SYS_STATUS_AHRS | mavlink.MAV_SYS_STATUS_SENSOR_GPS)
    return mavlink.MAVLink_sys_status_message(
        present, present, health, 300, round(_volts(view) * 1000), round(_amperes(view) * 100),
        round(view.battery * 100), 0, 0, 0, 0, 0, 0,
    )  # fmt: skip


def _volts(view: View) -> float:
    return CELLS * (EMPTY + (FULL - EMPTY) * view.battery)


def _amperes(view: View) -> float:
    return HOVER_CURRENT * view.thrust * 2 if view.armed else 0.3


def _battery_status(view: View) -> Message:
    cell = round(_volts(view) / CELLS * 1000)
    return mavlink.MAVLink_battery_status_message(
        0, 0, mavlink.MAV_BATTERY_TYPE_LIPO, 2500, [cell] * CELLS + [0xFFFF] * (10 - CELLS),
        round(_amperes(view) * 100), -1, -1, round(view.battery * 100),
    )  # fmt: skip


def _gps(view: View) -> Message:
    place = view.place
    fix = mavlink.GPS_FIX_TYPE_3D_FIX if view.estimator else mavlink.GPS_FIX_TYPE_NO_FIX
    north, east = float(view.velocity[0]), float(view.velocity[1])
    course = math.degrees(math.atan2(east, north)) % 360.0
    return mavlink.MAVLink_gps_raw_int_message(
        round(view.now * 1e6), fix, round(place.latitude * 1e7), round(place.longitude * 1e7),
        round(place.altitude * 1000), 80, 120, round(math.hypot(north, east) * 100) & 0xFFFF,
        round(course * 100) % 36_000, 12 if view.estimator else 0,
    )  # fmt: skip


def _global_position(view: View) -> Message | None:
    if not view.estimator:
        return None
    place = view.place
    speeds = [max(-32_767, min(32_767, round(float(v) * 100))) for v in view.velocity]
    return mavlink.MAVLink_global_position_int_message(
        view.ms, round(place.latitude * 1e7), round(place.longitude * 1e7),
        round(place.altitude * 1000), round((place.altitude - view.home.altitude) * 1000),
        *speeds, round(view.heading * 100) % 36_000,
    )  # fmt: skip


def _home(view: View) -> Message | None:
    if not view.estimator:
        return None
    return mavlink.MAVLink_home_position_message(
        round(view.home.latitude * 1e7), round(view.home.longitude * 1e7),
        round(view.home.altitude * 1000), *(float(v) for v in view.home_ned),
        [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, round(view.now * 1e6),
    )  # fmt: skip


def _origin(view: View) -> Message | None:
    if not view.estimator:
        return None
    o = view.origin
    return mavlink.MAVLink_gps_global_origin_message(
        round(o.latitude * 1e7), round(o.longitude * 1e7), round(o.altitude * 1000)
    )


def _quaternion(view: View) -> Message:
    roll, pitch, yaw = (angle / 2 for angle in view.attitude)
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return mavlink.MAVLink_attitude_quaternion_message(
        view.ms,
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        *(float(rate) for rate in view.rates),
    )


def _vfr_hud(view: View) -> Message:
    speed = math.hypot(float(view.velocity[0]), float(view.velocity[1]))
    return mavlink.MAVLink_vfr_hud_message(
        speed, speed, round(view.heading) % 360, round(view.thrust * 100), view.place.altitude,
        -float(view.velocity[2]),
    )  # fmt: skip


def _version(view: View) -> Message:
    flavour = view.flavour
    return mavlink.MAVLink_autopilot_version_message(
        flavour.capabilities, flavour.version, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, view.system
    )


def _extended(view: View) -> Message:
    return mavlink.MAVLink_extended_sys_state_message(
        mavlink.MAV_VTOL_STATE_UNDEFINED, view.landed_state
    )


def _system_time(view: View) -> Message:
    return mavlink.MAVLink_system_time_message(round((BOOT_TIME + view.now) * 1e6), view.ms)


BUILDERS: dict[int, Callable[[View], Message | None]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: _gps,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _quaternion,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: lambda v: local_position(v) if v.estimator else None,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: _origin,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _vfr_hud,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _battery_status,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: _version,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: _home,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _extended,
}

RATES = {  # Hz
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 4.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 25.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 25.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 4.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
}

DATA_STREAMS = {  # ArduPilot's groups of REQUEST_DATA_STREAM
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (1, 24, 42, 147, 245),
    mavlink.MAV_DATA_STREAM_POSITION: (32, 33),
    mavlink.MAV_DATA_STREAM_EXTRA1: (30,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (74,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (2, 242),
}


class Streams:
    """Which messages are sent by themselves, and when."""

    def __init__(self, *, running: bool) -> None:
        self._period: dict[int, float] = {0: 1.0}
        if running:
            self._period |= {id_: 1 / rate for id_, rate in RATES.items()}
        self._due: dict[int, float] = dict.fromkeys(self._period, 0.0)

    def period(self, id_: int) -> float | None:
        """Seconds between two of these; None if it is not sent."""
        return self._period.get(id_)

    def every(self, id_: int, seconds: float | None, now: float) -> None:
        """Send it that often from now on; None: no more.  The heartbeat goes on regardless."""
        if seconds is None:
            if id_:
                self._period.pop(id_, None)
                self._due.pop(id_, None)
            return
        self._period[id_] = max(seconds, SHORTEST)
        self._due[id_] = now

    def due(self, now: float) -> list[int]:
        """The messages to send now; keeps their rhythm, and skips what was missed."""
        ready = [id_ for id_, time in self._due.items() if time <= now + 1e-6]
        for id_ in ready:
            period = self._period[id_]
            missed = math.floor((now + 1e-6 - self._due[id_]) / period)
            self._due[id_] += (missed + 1) * period
        return ready
