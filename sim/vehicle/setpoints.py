"""What a set point means: type_mask, frame, NaN; pure functions from a message to a target.

A set bit of type_mask ignores its field.  PX4 takes x and y only together, ArduPilot ignores a
whole group (position, velocity, acceleration) when one of its bits is set.  The yaw of a body frame
is absolute on PX4; on ArduPilot it counts from the heading at every message.  A NaN in an ignored
field is fine;
a NaN yaw keeps the heading; on PX4 a NaN axis counts as ignored; on ArduPilot a NaN in use refuses
the set point.  A target is what ``control`` flies, see there.

Sources: PX4 ``MavlinkReceiver::handle_message_set_position_target_local_ned``, ArduPilot
``GCS_MAVLINK_Copter::handle_message_set_position_target_local_ned``.
"""

import math

import numpy as np

from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import Flavour
from sim.vehicle.frames import Doubles, Geodetic, ned_from_geodetic, ned_from_heading

NAN = math.nan
POSITION, VELOCITY, ACCELERATION = 0b111, 0b111 << 3, 0b111 << 6
FORCE, YAW, YAW_RATE = 1 << 9, 1 << 10, 1 << 11
FARTHEST = 1e5  # m or m/s; beyond it a number is nonsense

LOCAL_NED = mavlink.MAV_FRAME_LOCAL_NED
OFFSET_NED = mavlink.MAV_FRAME_LOCAL_OFFSET_NED
BODY_NED = mavlink.MAV_FRAME_BODY_NED
BODY_OFFSET = mavlink.MAV_FRAME_BODY_OFFSET_NED
ABOVE_SEA = {mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT}
ABOVE_HOME = {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}


def nothing() -> Doubles:
    """A target that asks for nothing: stop, keep the heading."""
    return np.full(8, NAN)


def hold_at(position: Doubles, yaw: float = NAN) -> Doubles:
    """A target that stays at a position (3,) NED."""
    target = nothing()
    target[0:3] = position
    target[6] = yaw
    return target


def from_local(message: Message, flavour: Flavour, position: Doubles, yaw: float) -> Doubles | None:
    """The target of a SET_POSITION_TARGET_LOCAL_NED, or None where the vehicle must ignore it.

    Args:
        message: the set point.
        flavour: whose rules.
        position: (3,) where the vehicle is, NED [m]; offsets count from here.
        yaw: where its nose points [rad]; body frames turn with it.
    """
    frame = message.coordinate_frame
    places, speeds = _groups(
        message.type_mask,
        (message.x, message.y, message.z),
        (message.vx, message.vy, message.vz),
        flavour,
    )
    if places is None or speeds is None:
        return None
    moves = any(not math.isnan(value) for value in places)
    if flavour.px4 and (frame not in {LOCAL_NED, BODY_NED} or (moves and frame != LOCAL_NED)):
        return None
    if frame not in {LOCAL_NED, OFFSET_NED, BODY_NED, BODY_OFFSET}:
        return None
    if frame in {BODY_NED, BODY_OFFSET}:
        speeds = (*ned_from_heading(yaw, speeds[0], speeds[1]), speeds[2])
        places = (*ned_from_heading(yaw, places[0], places[1]), places[2])
    target = nothing()
    target[0:3] = places
    if frame != LOCAL_NED:
        target[0:3] += position
    target[3:6] = speeds
    turned = not flavour.px4 and frame in {BODY_NED, BODY_OFFSET}
    return _with_yaw(target, message, yaw if turned else 0.0, flavour)


def complaint(message: Message) -> str:
    """What PX4 says to a SET_POSITION_TARGET_LOCAL_NED that it refuses, word by word."""
    head = "SET_POSITION_TARGET_LOCAL_NED"
    if message.coordinate_frame not in {LOCAL_NED, BODY_NED}:
        return f"{head} coordinate frame {message.coordinate_frame} unsupported"
    if message.type_mask & FORCE and message.type_mask & ACCELERATION != ACCELERATION:
        return f"{head} force not supported"
    return f"{head} invalid"


def from_global(
    message: Message, flavour: Flavour, origin: Geodetic, home: Geodetic
) -> Doubles | None:
    """The target of a SET_POSITION_TARGET_GLOBAL_INT; altitudes as its frame says."""
    frame = message.coordinate_frame
    if frame in ABOVE_SEA:
        altitude = message.alt
    elif frame in ABOVE_HOME:
        altitude = message.alt + home.altitude
    else:
        return None
    place = Geodetic(message.lat_int * 1e-7, message.lon_int * 1e-7, altitude)
    north, east, down = ned_from_geodetic(origin, place)
    places, speeds = _groups(
        message.type_mask, (north, east, down), (message.vx, message.vy, message.vz), flavour
    )
    if places is None or speeds is None:
        return None
    target = nothing()
    target[0:3], target[3:6] = places, speeds
    return _with_yaw(target, message, 0.0, flavour)


Triple = tuple[float, float, float]


def _groups(
    mask: int, places: Triple, speeds: Triple, flavour: Flavour
) -> tuple[Triple | None, Triple | None]:
    """Positions and velocities in use, NaN where ignored; None for one that makes no sense."""
    if mask & FORCE and mask & ACCELERATION != ACCELERATION:
        return None, None  # forces: neither of them supports that
    place = _group(places, mask, flavour)
    speed = _group(speeds, mask >> 3, flavour)
    if place is None or speed is None:
        return None, None
    if all(math.isnan(value) for value in place + speed):
        return None, None  # acceleration, attitude or nothing at all
    return place, speed


def _group(values: Triple, mask: int, flavour: Flavour) -> Triple | None:
    bits = mask & 0b111
    if not flavour.px4 and bits:
        bits = 0b111
    elif bits & 0b011:
        bits |= 0b011
    used = [NAN if bits >> axis & 1 else value for axis, value in enumerate(values)]
    if any(math.isinf(value) or abs(value) > FARTHEST for value in used):
        return None
    if not flavour.px4 and not bits and any(math.isnan(value) for value in used):
        return None
    return used[0], used[1], used[2]


def _with_yaw(target: Doubles, message: Message, base: float, flavour: Flavour) -> Doubles | None:
    """Add the heading; a NaN yaw or yaw rate keeps it."""
    yaw, rate = message.yaw, message.yaw_rate
    if not message.type_mask & YAW and not math.isnan(yaw):
        if not abs(yaw) <= FARTHEST:
            return None
        target[6] = base + yaw
    elif not message.type_mask & YAW_RATE and not math.isnan(rate):
        if not abs(rate) <= FARTHEST:
            return None
        target[7] = rate
    return target


def confine(
    target: Doubles, position: Doubles, home: Doubles, radius: float, height: float
) -> Doubles:
    """The target, kept inside a cylinder around home; what leads out slows down and stops.

    Args:
        target: (8,) see ``control``.
        position: (3,) where the vehicle is, NED [m].
        home: (3,) its centre, NED [m].
        radius: of the fence [m]; 0: none.
        height: of the fence above home [m]; 0: none.
    """
    kept = target.copy()
    if radius > 0:
        away = math.hypot(kept[0] - home[0], kept[1] - home[1])
        if away > radius:
            kept[0:2] = home[0:2] + (kept[0:2] - home[0:2]) * radius / away
        here = math.hypot(position[0] - home[0], position[1] - home[1])
        if here > 1e-6:
            outward = (position[0:2] - home[0:2]) / here
            speed = float(np.nan_to_num(kept[3:5]) @ outward)
            if math.isnan(kept[0]) or math.isnan(kept[1]):
                allowed = radius - here  # 1/s times metres: slows down towards the fence
                if speed > allowed:
                    kept[3:5] = np.nan_to_num(kept[3:5]) - (speed - allowed) * outward
            elif here >= radius and speed > 0:
                kept[3:5] -= speed * outward
    if height > 0:
        if not math.isnan(kept[2]):
            kept[2] = max(kept[2], home[2] - height)
        if kept[5] < 0:
            kept[5] = max(kept[5], min(0.0, -(height + position[2] - home[2])))
    return kept
