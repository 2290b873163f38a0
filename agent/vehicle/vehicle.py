"""A drone to fly: ``with Vehicle("udpin:0.0.0.0:14540") as drone: drone.take_off(2.0) ...``.

One thread owns connection and codec: it reads, keeps the newest telemetry, sends the heartbeat,
streams the set point at 20 Hz and looks after safety.  The caller's verbs put work into its queue
and wait for what they asked, each with a deadline.  A vehicle that refuses says why in one line.
"""

import logging
import math
import os
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Any, BinaryIO, Self

os.environ.setdefault("MAVLINK20", "1")

from pymavlink.dialects.v20 import common as mavlink

from agent.errors import VehicleError
from agent.vehicle.connection import Connection, open_connection
from agent.vehicle.dialects import Dialect, Mode, dialect_of
from agent.vehicle.safety import Action, Health, Limits, Timing, decide
from agent.vehicle.state import READERS, VehicleState

log = logging.getLogger(__name__)

COMPANION = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER  # 191
AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
LOCAL_NED, BODY_NED = mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_NED
POSITION_YAW, VELOCITY_YAW, VELOCITY_RATE = 2552, 2503, 1479  # type_mask
STREAMS = {32: 25.0, 30: 25.0, 33: 5.0, 245: 4.0, 1: 2.0, 24: 2.0}  # message -> Hz
FARTHEST = 1e6  # m or m/s; beyond it a number is nonsense
REACHED = 0.4  # m, a take-off that is this near is over
SIGNING_EPOCH = 1_420_070_400  # s, 2015-01-01

Message = Any
SetPoint = tuple[int, int, tuple[float, ...]]  # frame, type_mask, x y z vx vy vz yaw yaw_rate


class Vehicle:
    """One drone.

    Args:
        connection: see ``connection``.
        timing: how long to wait.
        limits: what is never asked for.
        system: its system id; 0: whichever autopilot is heard first.
        key: 32 bytes; sign, and believe only what is signed.
        record: every frame goes here as a .tlog.

    Raises:
        VehicleError: on entering, when no autopilot is heard in time; by every verb, when the
            vehicle refuses, does not answer, or the flight was broken off.
    """

    def __init__(
        self,
        connection: str,
        timing: Timing | None = None,
        limits: Limits | None = None,
        *,
        system: int = 0,
        key: bytes | None = None,
        record: BinaryIO | None = None,
    ) -> None:
        self.timing, self.limits = timing or Timing(), limits or Limits()
        self.text = connection
        self.system = system
        self._key, self._record = key, record
        self._news = threading.Condition()
        self._state = VehicleState()
        self._dialect: Dialect | None = None
        self._outbox: deque[Message] = deque()
        self._acks: dict[int, int] = {}
        self._texts: deque[tuple[float, str]] = deque(maxlen=20)
        self._stop = threading.Event()
        self._connection: Connection | None = None
        self._thread: threading.Thread | None = None
        self._codec: Any = None
        # what the thread streams
        self._setpoint: SetPoint | None = None
        self._setpoint_at = -math.inf
        self._finite = True
        self._guided = False  # we have been obeyed: watch that it stays so
        self._held_since: float | None = None
        self._broken: str | None = None  # why the flight was broken off
        self._ending: Mode | None = None  # the mode that safety insists on
        self._insisted = -math.inf  # when it last did
        self._home = (0.0, 0.0, 0.0)

    # -- life ----------------------------------------

    def __enter__(self) -> Self:
        self._connection = open_connection(self.text, self.timing.connect)
        self._codec = mavlink.MAVLink(None, self.system or 1, COMPANION)
        self._codec.robust_parsing = True
        if self._key is not None:
            self._codec.signing.secret_key = self._key
            self._codec.signing.sign_outgoing = True
            self._codec.signing.timestamp = int((time.time() - SIGNING_EPOCH) * 100_000)
        self._thread = threading.Thread(target=self._run, name="vehicle", daemon=True)
        self._thread.start()
        try:
            self._await(
                lambda s: s.heartbeat_at > 0,
                self.timing.connect,
                f"no autopilot is heard on {self.text}",
            )
            self._dialect = dialect_of(self._state.autopilot)
            self._codec.srcSystem = self.system
            self._request_streams()
        except BaseException:
            self.close()
            raise
        log.info("vehicle %d on %s: %s", self.system, self.text, self.dialect.name)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Stop talking.  A drone in the air then holds, as its autopilot does by itself."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(5.0)
        if self._connection is not None:
            self._connection.close()

    # -- what is known ----------------------------------------

    @property
    def dialect(self) -> Dialect:
        """Whose autopilot it is."""
        if self._dialect is None:
            raise VehicleError(f"vehicle on {self.text} is not connected")
        return self._dialect

    @property
    def state(self) -> VehicleState:
        """The newest telemetry."""
        return self._state

    @property
    def broken_off(self) -> str | None:
        """Why safety has ended the flight; None while all is well."""
        return self._broken

    @property
    def name(self) -> str:
        """What messages call it."""
        kind = self._dialect.name if self._dialect is not None else "unknown"
        return f"vehicle {self.system} ({kind})"

    # -- verbs ----------------------------------------

    def wait_ready(self) -> None:
        """Wait until the vehicle has a position and would arm."""
        self._await(
            lambda s: (
                time.monotonic() - s.position_at < self.timing.telemetry
                and s.prearm_ok is True
                and not math.isnan(s.altitude)
            ),
            self.timing.ready,
            "is not ready to arm",
        )

    def take_off(self, height: float) -> None:
        """Arm, climb to a height [m], and be ready for set points."""
        if not 0 < height <= self.limits.height:
            raise VehicleError(
                f"take-off to {height:g} m: expected more than 0, at most {self.limits.height:g}"
            )
        self.wait_ready()
        dialect = self.dialect
        self.set_mode(dialect.before_arming)
        self._command("arm", mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        self._await(lambda s: s.armed, self.timing.mode, "does not report that it is armed")
        start = self._state
        self._home = start.position
        aim = height + (start.altitude if dialect.takeoff_above_sea else 0.0)
        nan = math.nan if dialect.takeoff_above_sea else 0.0
        self._command("take off", mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan, nan, nan, aim)
        self._await(
            lambda s: abs(start.position[2] - s.position[2] - height) < REACHED,
            self.timing.takeoff,
            f"does not reach {height:g} m",
        )
        self._begin_streaming()

    def fly_to(self, x: float, y: float, z: float, yaw: float) -> None:
        """Ask for a place [m, local NED] and a heading [rad]; returns at once."""
        self._check_alive()
        if self._is_finite(x, y, z, yaw):
            x, y, z = self.limits.place_within(x, y, z, self._home)
            self._wish(LOCAL_NED, POSITION_YAW, (x, y, z, 0.0, 0.0, 0.0, yaw, 0.0))

    def fly_at(self, vx: float, vy: float, vz: float, yaw: float) -> None:
        """Ask for a velocity [m/s, NED] and a heading [rad]; returns at once."""
        self._check_alive()
        if self._is_finite(vx, vy, vz, yaw):
            vx, vy, vz = self.limits.speed_within(vx, vy, vz)
            self._wish(LOCAL_NED, VELOCITY_YAW, (0.0, 0.0, 0.0, vx, vy, vz, yaw, 0.0))

    def fly_ahead(self, forward: float, right: float, down: float, turn: float) -> None:
        """Ask for a velocity along the nose [m/s] and a yaw rate [rad/s]; returns at once."""
        self._check_alive()
        if self._is_finite(forward, right, down, turn):
            vx, vy, vz = self.limits.speed_within(forward, right, down)
            self._wish(BODY_NED, VELOCITY_RATE, (0.0, 0.0, 0.0, vx, vy, vz, 0.0, turn))

    def hold(self) -> None:
        """Stand still, by the autopilot's own mode; set points stop."""
        self._end_streaming()
        self.set_mode(self.dialect.hold)

    def land(self) -> None:
        """Land here; returns when the vehicle has disarmed itself."""
        self._end_streaming()
        self.set_mode(self.dialect.land)
        self._await(lambda s: not s.armed, self.timing.land, "does not disarm after landing")

    def disarm(self) -> None:
        """Stop the rotors; refused in the air."""
        self._end_streaming()
        self._command("disarm", mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)

    def set_mode(self, mode: Mode) -> None:
        """Enter a mode, and see that it is reported."""
        custom = self.dialect.custom_mode(mode)
        if self._state.custom_mode == custom:
            return
        flag = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self._command(f"enter mode {mode[0]}.{mode[1]}", mavlink.MAV_CMD_DO_SET_MODE, flag, *mode)
        self._await(
            lambda s: s.custom_mode == custom, self.timing.mode, f"does not enter mode {mode}"
        )

    # -- how the verbs work ----------------------------------------

    def _begin_streaming(self) -> None:
        """Hold this place by set points, and have them obeyed."""
        x, y, z = self._state.position
        hold = (x, y, z, 0.0, 0.0, 0.0, self._state.attitude[2], 0.0)
        self._guided = False
        self._held_since = self._broken = self._ending = None
        self._wish(LOCAL_NED, POSITION_YAW, hold)
        if self.dialect.stream_first:  # at least half a second of them
            self._stop.wait(self.timing.stream * 10)
        self._wish(LOCAL_NED, POSITION_YAW, hold)
        self.set_mode(self.dialect.guided)
        self._wish(LOCAL_NED, POSITION_YAW, hold)
        self._guided = True

    def _end_streaming(self) -> None:
        with self._news:
            self._guided, self._setpoint = False, None
            self._ending = None

    def _wish(self, frame: int, mask: int, values: tuple[float, ...]) -> None:
        with self._news:
            self._setpoint = (frame, mask, values)
            self._setpoint_at = time.monotonic()

    def _is_finite(self, *values: float) -> bool:
        """Whether these are sensible numbers; otherwise safety takes over."""
        if all(abs(value) <= FARTHEST for value in values):  # false for NaN
            return True
        self._finite = False
        return False

    def _check_alive(self) -> None:
        if self._broken is not None:
            raise VehicleError(f"{self.name}: flight broken off: {self._broken}")
        if self._setpoint is None:
            raise VehicleError(f"{self.name} has not taken off")

    def _command(self, what: str, id_: int, *params: float) -> None:
        """Send a command until it is answered.

        Raises:
            VehicleError: it is refused, or nobody answers.
        """
        padded = [*params, *[0.0] * (7 - len(params))]
        begun = time.monotonic()
        with self._news:
            self._acks.pop(id_, None)
        end = begun + self.timing.command
        attempt = 0
        while time.monotonic() < end:
            self._outbox.append(
                mavlink.MAVLink_command_long_message(
                    self.system, AUTOPILOT, id_, min(attempt, 255), *padded
                )
            )
            attempt += 1
            with self._news:
                self._news.wait_for(
                    lambda: id_ in self._acks, min(self.timing.retry, end - time.monotonic())
                )
                result = self._acks.pop(id_, None)
            if result == mavlink.MAV_RESULT_ACCEPTED:
                return
            if result == mavlink.MAV_RESULT_IN_PROGRESS:
                continue
            if result is not None:
                raise VehicleError(
                    f"{self.name} refuses to {what}: {_result(result)}{self._said(begun)}"
                )
        raise VehicleError(
            f"{self.name} does not answer to {what!r} within {self.timing.command:g} s"
        )

    def _said(self, since: float) -> str:
        """What it said lately, in brackets."""
        texts = list(dict.fromkeys(text for at, text in list(self._texts) if at >= since - 1.0))
        return f" ({'; '.join(texts[-3:])})" if texts else ""

    def _await(self, condition: Callable[[VehicleState], bool], seconds: float, what: str) -> None:
        """Wait for telemetry that says so.

        Raises:
            VehicleError: it does not within `seconds`.
        """
        begun = time.monotonic()
        with self._news:
            if self._news.wait_for(lambda: condition(self._state), seconds):
                return
        state = self._state
        missing = []
        if begun - state.heartbeat_at > self.timing.link:
            missing.append("no heartbeat")
        elif time.monotonic() - state.position_at > self.timing.telemetry:
            missing.append("no position")
        if state.prearm_ok is False:
            missing.append("arming checks fail")
        why = f": {', '.join(missing)}" if missing else ""
        raise VehicleError(f"{self.name} {what} within {seconds:g} s{why}{self._said(begun - 10)}")

    def _request_streams(self) -> None:
        request, interval = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        self._command("send its version", request, 148)
        for id_, rate in STREAMS.items():
            self._command(f"stream message {id_}", interval, id_, 1e6 / rate)

    # -- the thread ----------------------------------------

    def _run(self) -> None:
        try:
            self._talk()
        finally:
            if not self._stop.is_set():  # an error of ours: the verbs must not wait in vain
                self._broken = "the thread of the connection has ended"

    def _talk(self) -> None:
        assert self._connection is not None
        next_heartbeat = next_tick = time.monotonic()
        while not self._stop.is_set():
            now = time.monotonic()
            if now >= next_heartbeat:
                next_heartbeat = now + self.timing.heartbeat
                self._send(
                    mavlink.MAVLink_heartbeat_message(
                        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0,
                        mavlink.MAV_STATE_ACTIVE, 3,
                    )
                )  # fmt: skip
            if now >= next_tick:
                next_tick = max(next_tick + self.timing.stream, now)
                self._look_after(now)
            while self._outbox:
                self._send(self._outbox.popleft())
            wait = min(next_tick, next_heartbeat) - time.monotonic()
            data = self._connection.receive(min(max(wait, 0.0), 0.02))
            if data:
                for message in self._codec.parse_buffer(bytearray(data)) or ():
                    self._take(message)

    def _send(self, message: Message) -> None:
        assert self._connection is not None
        frame = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        self._keep(frame)
        self._connection.send(frame)

    def _keep(self, frame: bytes) -> None:
        if self._record is not None:
            self._record.write(struct.pack(">Q", time.time_ns() // 1000) + frame)

    def _look_after(self, now: float) -> None:
        """Stream the set point, or do what safety says."""
        setpoint = self._setpoint
        if setpoint is None:
            return
        action, reason = Action.FLY, ""
        if self._guided or self._held_since is not None:
            action, reason = decide(self._health(now), self.limits, self.timing)
        if action is Action.FLY:
            frame, mask, v = setpoint
            self._send(
                mavlink.MAVLink_set_position_target_local_ned_message(
                    max(self._state.time_boot_ms, 0), self.system, AUTOPILOT, frame, mask,
                    *v[0:6], 0.0, 0.0, 0.0, v[6], v[7],
                )
            )  # fmt: skip
            return
        if self._held_since is None:
            log.error("%s: %s: holding, then landing", self.name, reason)
            self._held_since, self._broken = now, reason
        mode = self.dialect.land if action is Action.LAND else self.dialect.hold
        self._insist(mode)

    def _insist(self, mode: Mode) -> None:
        """Ask for a mode again and again, until it is reported or the vehicle is down."""
        if self._ending != mode:
            self._ending, self._insisted = mode, -math.inf
        state, now = self._state, time.monotonic()
        obeyed = state.custom_mode == self.dialect.custom_mode(mode)
        if obeyed or not state.armed or now - self._insisted < self.timing.retry:
            return
        self._insisted = now
        self._send(
            mavlink.MAVLink_command_long_message(
                self.system, AUTOPILOT, mavlink.MAV_CMD_DO_SET_MODE, 0,
                mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, *mode, 0, 0, 0, 0,
            )
        )  # fmt: skip

    def _health(self, now: float) -> Health:
        s, home = self._state, self._home
        return Health(
            heartbeat_age=now - s.heartbeat_at,
            position_age=now - s.position_at,
            setpoint_age=now - self._setpoint_at,
            estimator_ok=s.estimator_ok,
            finite=self._finite and all(map(math.isfinite, (*s.position, *s.velocity))),
            distance=math.hypot(s.position[0] - home[0], s.position[1] - home[1]),
            height=home[2] - s.position[2],
            battery=s.battery,
            guided=s.custom_mode == self.dialect.custom_mode(self.dialect.guided) and s.armed,
            held=None if self._held_since is None else now - self._held_since,
        )

    def _take(self, message: Message) -> None:
        """Keep what a message says."""
        kind = message.get_type()
        if kind == "BAD_DATA" or kind.startswith("UNKNOWN"):
            return
        self._keep(bytes(message.get_msgbuf()))
        if message.get_srcComponent() != AUTOPILOT:
            return
        if self.system == 0 and kind == "HEARTBEAT":
            self.system = message.get_srcSystem()
        if message.get_srcSystem() != self.system:
            return
        with self._news:
            if kind == "COMMAND_ACK":
                self._acks[message.command] = message.result
            elif kind == "STATUSTEXT":
                self._texts.append((time.monotonic(), message.text))
                log.info("%s says: %s", self.name, message.text)
            else:
                reader = READERS.get(kind)
                if reader is None:
                    return
                self._state = reader(self._state, message, time.monotonic())
            self._news.notify_all()


def _result(result: int) -> str:
    entry = mavlink.enums["MAV_RESULT"].get(result)
    return str(entry.name).removeprefix("MAV_RESULT_") if entry is not None else f"result {result}"
