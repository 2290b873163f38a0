"""Parameters: names as the two autopilots have them, types, and how they travel.

PX4 puts the bytes of an integer into the float field, ArduPilot casts; AUTOPILOT_VERSION's
capabilities say which.  Units and meaning are those of the autopilots' own references
(docs.px4.io, ardupilot.org/copter/docs/parameters.html).
"""

import math
import struct
from dataclasses import dataclass

from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import Flavour

INT32, REAL32 = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32


@dataclass(frozen=True)
class Parameter:
    """One parameter: where it starts, and what it may be."""

    default: float | int  # an int makes it an integer
    low: float
    high: float

    @property
    def type(self) -> int:
        return int(INT32 if isinstance(self.default, int) else REAL32)


_PX4 = {
    "BAT_CRIT_THR": Parameter(0.07, 0.0, 0.5),
    "COM_DISARM_LAND": Parameter(2.0, -1.0, 20.0),
    "COM_DISARM_PRFLT": Parameter(10.0, -1.0, 600.0),
    "COM_OBL_RC_ACT": Parameter(5, 0, 255),  # 0 sinks (PX4's default), 3 return, 4 land, else hold
    "COM_OF_LOSS_T": Parameter(1.0, 0.0, 60.0),
    "GF_MAX_HOR_DIST": Parameter(0.0, 0.0, 10_000.0),
    "GF_MAX_VER_DIST": Parameter(0.0, 0.0, 10_000.0),
    "MAV_SYS_ID": Parameter(1, 1, 250),
    "MIS_TAKEOFF_ALT": Parameter(2.5, 0.5, 80.0),
    "MPC_LAND_SPEED": Parameter(0.7, 0.2, 2.0),
    "MPC_XY_CRUISE": Parameter(5.0, 0.5, 12.0),
    "MPC_XY_VEL_MAX": Parameter(8.0, 0.5, 12.0),
    "MPC_Z_VEL_MAX_DN": Parameter(1.5, 0.5, 4.0),
    "MPC_Z_VEL_MAX_UP": Parameter(3.0, 0.5, 8.0),
    "RTL_RETURN_ALT": Parameter(5.0, 0.5, 150.0),
    "SIM_BAT_DRAIN": Parameter(600.0, 1.0, 86_400.0),
    "SIM_BAT_MIN_PCT": Parameter(50.0, 0.0, 100.0),
    "SYS_AUTOSTART": Parameter(10_040, 0, 99_999),
}

_ARDUPILOT = {
    "ARMING_CHECK": Parameter(1, 1, 1),
    "BATT_CRT_MAH": Parameter(0.0, 0.0, 100_000.0),
    "BATT_FS_CRT_PCT": Parameter(7.0, 0.0, 50.0),
    "DISARM_DELAY": Parameter(10, 0, 127),
    "FENCE_ALT_MAX": Parameter(0.0, 0.0, 1_000.0),
    "FENCE_RADIUS": Parameter(0.0, 0.0, 10_000.0),
    "FRAME_CLASS": Parameter(1, 0, 20),
    "GUID_TIMEOUT": Parameter(3.0, 0.1, 5.0),
    "LAND_SPEED": Parameter(70.0, 30.0, 200.0),  # cm/s
    "PILOT_TKOFF_ALT": Parameter(250.0, 0.0, 1_000.0),  # cm
    "RTL_ALT": Parameter(500, 30, 30_000),  # cm
    "SIM_BAT_DRAIN": Parameter(600.0, 1.0, 86_400.0),
    "SIM_BAT_MIN_PCT": Parameter(50.0, 0.0, 100.0),
    "SYSID_THISMAV": Parameter(1, 1, 255),
    "WPNAV_SPEED": Parameter(500.0, 10.0, 1_200.0),  # cm/s
    "WPNAV_SPEED_DN": Parameter(150.0, 10.0, 500.0),  # cm/s
    "WPNAV_SPEED_UP": Parameter(250.0, 10.0, 1_000.0),  # cm/s
}


@dataclass(frozen=True)
class Limits:
    """The parameters that matter, in SI units, whoever's names they have."""

    speed: float  # m/s, most that is ever flown horizontally
    cruise: float  # m/s, on missions and the way home
    up: float  # m/s
    down: float  # m/s
    landing: float  # m/s
    takeoff_height: float  # m
    return_height: float  # m
    fence_radius: float  # m, 0: none
    fence_height: float  # m, 0: none
    setpoint_timeout: float  # s
    critical_battery: float  # share
    disarm_landed: float  # s, negative: never
    disarm_waiting: float  # s after arming without taking off, negative: never


class Parameters:
    """The values of one vehicle."""

    def __init__(self, flavour: Flavour, system: int) -> None:
        self._flavour = flavour
        self._table = _PX4 if flavour.px4 else _ARDUPILOT
        self._names = sorted(self._table)
        self._values: dict[str, float | int] = {n: self._table[n].default for n in self._names}
        self._values["MAV_SYS_ID" if flavour.px4 else "SYSID_THISMAV"] = system
        self.limits = self._limits()

    def __getitem__(self, name: str) -> float | int:
        return self._values[name]

    def __len__(self) -> int:
        return len(self._names)

    def set(self, name: str, value: float) -> bool:
        """Take a value; False where it is unknown or out of range."""
        known = self._table.get(name)
        if known is None or not known.low <= value <= known.high:
            return False
        self._values[name] = round(value) if known.type == INT32 else value
        self.limits = self._limits()
        return True

    # -- messages ----------------------------------------------------------------------------------

    def all(self) -> list[Message]:
        """PARAM_VALUE of every parameter."""
        return [self._message(index) for index in range(len(self))]

    def read(self, name: str, index: int) -> Message | None:
        """PARAM_VALUE of one, by name, or by index where that is not -1."""
        if index >= 0:
            return self._message(index) if index < len(self) else None
        return self._message(self._names.index(name)) if name in self._values else None

    def write(self, name: str, value: float, type_: int) -> Message | None:
        """Take the value of a PARAM_SET; answer with what holds now, None if it is unknown."""
        known = self._table.get(name)
        if known is None:
            return None
        if known.type == type_ or not self._flavour.px4:  # ArduPilot takes any type
            self.set(name, self._decode(value, known.type))
        return self.read(name, -1)

    def _message(self, index: int) -> Message:
        name = self._names[index]
        type_ = self._table[name].type
        return mavlink.MAVLink_param_value_message(
            name.encode(), self._encode(self._values[name], type_), type_, len(self), index
        )

    def _encode(self, value: float, type_: int) -> float:
        if type_ == INT32 and self._flavour.px4:
            bits: tuple[float] = struct.unpack("<f", struct.pack("<i", int(value)))
            return bits[0]
        return float(value)

    def _decode(self, value: float, type_: int) -> float:
        if type_ == INT32 and self._flavour.px4:
            whole: tuple[int] = struct.unpack("<i", struct.pack("<f", value))
            return whole[0]
        return value if math.isfinite(value) else math.nan

    # -- meaning -----------------------------------------------------------------------------------

    def _limits(self) -> Limits:
        v = self._values
        if self._flavour.px4:
            return Limits(
                speed=v["MPC_XY_VEL_MAX"],
                cruise=v["MPC_XY_CRUISE"],
                up=v["MPC_Z_VEL_MAX_UP"],
                down=v["MPC_Z_VEL_MAX_DN"],
                landing=v["MPC_LAND_SPEED"],
                takeoff_height=v["MIS_TAKEOFF_ALT"],
                return_height=v["RTL_RETURN_ALT"],
                fence_radius=v["GF_MAX_HOR_DIST"],
                fence_height=v["GF_MAX_VER_DIST"],
                setpoint_timeout=v["COM_OF_LOSS_T"],
                critical_battery=v["BAT_CRIT_THR"],
                disarm_landed=v["COM_DISARM_LAND"],
                disarm_waiting=v["COM_DISARM_PRFLT"],
            )
        return Limits(
            speed=v["WPNAV_SPEED"] / 100,
            cruise=v["WPNAV_SPEED"] / 100,
            up=v["WPNAV_SPEED_UP"] / 100,
            down=v["WPNAV_SPEED_DN"] / 100,
            landing=v["LAND_SPEED"] / 100,
            takeoff_height=v["PILOT_TKOFF_ALT"] / 100,
            return_height=v["RTL_ALT"] / 100,
            fence_radius=v["FENCE_RADIUS"],
            fence_height=v["FENCE_ALT_MAX"],
            setpoint_timeout=v["GUID_TIMEOUT"],
            critical_battery=v["BATT_FS_CRT_PCT"] / 100,
            disarm_landed=0.2,
            disarm_waiting=v["DISARM_DELAY"] or -1.0,
        )
