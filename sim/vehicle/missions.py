"""The mission protocol: upload, download, clear, the current item.  No flying here.

Interface: :class:`MissionStore`, ``handle(message, now) -> replies`` and ``advance(now)``.
Source: https://mavlink.io/en/services/mission.html
"""

import math
from dataclasses import dataclass

from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import Flavour
from sim.vehicle.frames import Geodetic

MISSION = mavlink.MAV_MISSION_TYPE_MISSION
MOST_ITEMS = 1000


@dataclass(frozen=True)
class Patience:
    """How long an upload waits for an item; as observed on the real stacks."""

    again: float  # s, then it asks again
    give_up: float  # s, then it ends


PX4_PATIENCE, ARDUPILOT_PATIENCE = Patience(0.25, 5.0), Patience(1.0, 8.0)

FLOWN = {
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_NAV_LAND,
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_DELAY,
    mavlink.MAV_CMD_DO_CHANGE_SPEED,
}
PLACELESS = {  # what stands in their coordinates means nothing
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_NAV_DELAY,
    mavlink.MAV_CMD_DO_CHANGE_SPEED,
}
FRAMES = {  # frame -> whether its altitude is above home
    mavlink.MAV_FRAME_GLOBAL: False,
    mavlink.MAV_FRAME_GLOBAL_INT: False,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT: True,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: True,
    mavlink.MAV_FRAME_MISSION: True,
}


@dataclass(frozen=True)
class Item:
    """One item, as it came."""

    frame: int
    command: int
    params: tuple[float, float, float, float]
    x: int  # latitude [1e-7 deg]
    y: int  # longitude [1e-7 deg]
    z: float  # altitude [m], above what the frame says
    autocontinue: int = 1

    def place(self, home: Geodetic) -> Geodetic:
        """Where it is; an item without coordinates is above home."""
        altitude = self.z + (home.altitude if FRAMES[self.frame] else 0.0)
        if self.x == 0 and self.y == 0:
            return Geodetic(home.latitude, home.longitude, altitude)
        return Geodetic(self.x * 1e-7, self.y * 1e-7, altitude)


@dataclass
class _Upload:
    """Items on their way to us."""

    partner: tuple[int, int]
    count: int
    items: list[Item]
    asked: float  # s, when the next one was asked for
    tries: int = 1
    integers: bool = True  # MISSION_ITEM_INT, not MISSION_ITEM


class MissionStore:
    """The mission of one vehicle, and the conversation about it."""

    def __init__(self, flavour: Flavour) -> None:
        self.items: list[Item] = []
        self.current = 0
        self.changed = False  # since the autopilot last looked
        self._flavour = flavour
        self._upload: _Upload | None = None
        self._last: tuple[tuple[int, int], int] | None = None  # who uploaded, its last seq

    def handle(self, message: Message, now: float) -> list[Message]:
        """Replies to a message of the mission protocol; other messages get none."""
        partner = (message.get_srcSystem(), message.get_srcComponent())
        kind = message.get_type()
        type_ = getattr(message, "mission_type", MISSION)
        if kind == "MISSION_COUNT":
            return self._begin(partner, message.count, type_, now)
        if kind in {"MISSION_ITEM_INT", "MISSION_ITEM"}:
            return self._take(partner, message, type_, now)
        if kind == "MISSION_REQUEST_LIST":
            count = len(self.items) if type_ == MISSION else 0
            return [mavlink.MAVLink_mission_count_message(*partner, count, type_)]
        if kind in {"MISSION_REQUEST_INT", "MISSION_REQUEST"}:
            if type_ != MISSION or message.seq >= len(self.items):
                return [_ack(partner, mavlink.MAV_MISSION_ERROR, type_)]
            return [self._item(partner, message.seq, integers=kind == "MISSION_REQUEST_INT")]
        if kind == "MISSION_CLEAR_ALL":
            if type_ in {MISSION, mavlink.MAV_MISSION_TYPE_ALL}:
                if self._upload is not None and self._flavour.px4:
                    return [_text("WPM: IGN CLEAR CMD: Busy")]
                self._upload = self._last = None
                self.items, self.current, self.changed = [], 0, True
            return [_ack(partner, mavlink.MAV_MISSION_ACCEPTED, type_)]
        if kind == "MISSION_SET_CURRENT":
            self.set_current(message.seq)
            return [self.current_message()]
        return []

    def advance(self, now: float) -> list[Message]:
        """Ask again for an item that did not come; in the end give up."""
        upload = self._upload
        patience = PX4_PATIENCE if self._flavour.px4 else ARDUPILOT_PATIENCE
        if upload is None or now - upload.asked < patience.again:
            return []
        if upload.tries * patience.again >= patience.give_up:
            self._upload = None
            if self._flavour.px4:
                return [_text("Operation timeout")]
            cancelled = _ack(upload.partner, mavlink.MAV_MISSION_OPERATION_CANCELLED, MISSION)
            return [cancelled, _text("Mission upload timeout")]
        upload.asked, upload.tries = now, upload.tries + 1
        return [_request(upload)]

    def set_current(self, index: int) -> bool:
        """Go on with another item; False if there is none of that number."""
        if not 0 <= index < len(self.items):
            return False
        self.current, self.changed = index, True
        return True

    def current_message(self) -> Message:
        """MISSION_CURRENT."""
        total = len(self.items)
        state = mavlink.MISSION_STATE_NO_MISSION if not total else mavlink.MISSION_STATE_UNKNOWN
        return mavlink.MAVLink_mission_current_message(self.current, total, state)

    def _begin(self, partner: tuple[int, int], count: int, type_: int, now: float) -> list[Message]:
        if type_ != MISSION and count > 0:
            return [_ack(partner, mavlink.MAV_MISSION_UNSUPPORTED, type_)]
        if self._upload is not None and self._upload.partner != partner:
            return [_ack(partner, mavlink.MAV_MISSION_DENIED, type_)]
        if count > MOST_ITEMS:
            return [_ack(partner, mavlink.MAV_MISSION_NO_SPACE, type_)]
        if count == 0:
            if type_ == MISSION:
                self.items, self.current, self.changed = [], 0, True
            return [_ack(partner, mavlink.MAV_MISSION_ACCEPTED, type_)]
        if self._upload is not None and self._upload.items and self._flavour.px4:
            text = _text("WPM: IGN MISSION_COUNT: Busy")
            return [text, _ack(partner, mavlink.MAV_MISSION_ERROR, MISSION)]
        self._upload = _Upload(partner, count, [], now)
        return [_request(self._upload)]

    def _take(
        self, partner: tuple[int, int], message: Message, type_: int, now: float
    ) -> list[Message]:
        upload = self._upload
        if type_ == MISSION and upload is None and self._last == (partner, message.seq):
            again = mavlink.MAV_MISSION_ACCEPTED if self._flavour.px4 else mavlink.MAV_MISSION_ERROR
            return [_ack(partner, again, MISSION)]
        if type_ == MISSION and upload is None and not self._flavour.px4:
            return [_ack(partner, mavlink.MAV_MISSION_ERROR, MISSION)]
        if upload is None or upload.partner != partner or type_ != MISSION:
            return []
        if message.seq != len(upload.items):
            upload.asked = now
            return [_request(upload)]
        item, verdict = parse(message)
        if item is None:
            self._upload = None
            return [_ack(partner, verdict, MISSION)]
        upload.items.append(item)
        upload.asked, upload.tries = now, 1
        if len(upload.items) < upload.count:
            return [_request(upload)]
        self._upload, self._last = None, (partner, message.seq)
        self.items, self.current, self.changed = upload.items, 0, True
        return [_ack(partner, mavlink.MAV_MISSION_ACCEPTED, MISSION), self.current_message()]

    def _item(self, partner: tuple[int, int], index: int, *, integers: bool) -> Message:
        item = self.items[index]
        head = (*partner, index, item.frame, item.command, int(index == self.current))
        tail = (item.autocontinue, *item.params)
        if integers:
            return mavlink.MAVLink_mission_item_int_message(*head, *tail, item.x, item.y, item.z)
        return mavlink.MAVLink_mission_item_message(
            *head, *tail, item.x * 1e-7, item.y * 1e-7, item.z
        )


def parse(message: Message) -> tuple[Item | None, int]:
    """The item of a MISSION_ITEM(_INT), or None and why not."""
    if message.command not in FLOWN:
        return None, mavlink.MAV_MISSION_UNSUPPORTED
    if message.frame not in FRAMES:
        return None, mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        if not (abs(x) <= 90 and abs(y) <= 180):
            return None, mavlink.MAV_MISSION_INVALID_PARAM5_X
        x, y = round(x * 1e7), round(y * 1e7)
    placed = message.command not in PLACELESS
    if placed and not abs(x) <= 900_000_000:
        return None, mavlink.MAV_MISSION_INVALID_PARAM5_X
    if placed and not abs(y) <= 1_800_000_000:
        return None, mavlink.MAV_MISSION_INVALID_PARAM6_Y
    if placed and not abs(message.z) <= 10_000:  # also NaN
        return None, mavlink.MAV_MISSION_INVALID_PARAM7
    params = (message.param1, message.param2, message.param3, message.param4)
    if any(math.isinf(value) for value in params):
        return None, mavlink.MAV_MISSION_INVALID
    frame, command = message.frame, message.command
    return Item(frame, command, params, x, y, message.z, message.autocontinue), 0


def _request(upload: _Upload) -> Message:
    return mavlink.MAVLink_mission_request_int_message(*upload.partner, len(upload.items), MISSION)


def _text(words: str) -> Message:
    return mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_ERROR, words.encode())


def _ack(partner: tuple[int, int], result: int, type_: int) -> Message:
    return mavlink.MAVLink_mission_ack_message(*partner, result, type_)
