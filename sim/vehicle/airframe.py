"""What the quadrotor is made of, from ``airframe.toml``: every number has a unit and a source."""

import math
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

FILE = Path(__file__).with_name("airframe.toml")


class Airframe(NamedTuple):
    """The rigid body and its rotors (units in the file)."""

    mass: float
    inertia_x: float
    inertia_y: float
    inertia_z: float
    arm_x: float
    arm_y: float
    rotor_thrust: float
    rotor_torque: float
    rotor_lag: float
    linear_drag: float
    angular_drag: float
    radius: float
    legs: float
    gravity: float


class Gains(NamedTuple):
    """How it is flown (units in the file)."""

    position: float
    velocity: float
    velocity_integral: float
    attitude: float
    heading: float
    rate: float
    rate_yaw: float
    brake: float
    acceleration: float
    tilt: float
    turn_rate: float


def load(path: Path = FILE) -> tuple[Airframe, Gains]:
    """The airframe and the gains of a file.

    Raises:
        ValueError: the message names the key and what was expected.
    """
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    return (
        Airframe(*_values(tables, "airframe", Airframe._fields)),
        Gains(*_values(tables, "gains", Gains._fields)),
    )


def _values(tables: dict[str, Any], name: str, fields: tuple[str, ...]) -> list[float]:
    table = tables.get(name, {})
    if set(table) != set(fields):
        odd = ", ".join(sorted(set(table) ^ set(fields)))
        raise ValueError(f"[{name}]: missing or unknown: {odd}")
    values = []
    for field in fields:
        entry = table[field]
        if set(entry) != {"value", "unit", "source"}:
            raise ValueError(f"{name}.{field}: expected value, unit and source")
        value = float(entry["value"])
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name}.{field} = {value}: expected a positive number")
        values.append(value)
    return values
