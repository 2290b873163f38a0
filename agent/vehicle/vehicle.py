"""A drone to fly: ``with Vehicle("udpin:0.0.0.0:14540") as drone: drone.take_off(2.0) ...``.

The verbs say what a flight is made of; ``conversation`` carries them, ``helm`` decides what is
streamed meanwhile.  Every wait has a deadline; a vehicle that refuses says why in one line.
"""

import logging
import math
import time
from collections.abc import Callable
from typing import Self

from agent.errors import RefusedError, TakenOverError, VehicleError
from agent.vehicle.conversation import Conversation
from agent.vehicle.dialects import Dialect, Mode, dialect_of, mavlink
from agent.vehicle.helm import (
    BODY_NED,
    LOCAL_NED,
    POSITION_YAW,
    VELOCITY_RATE,
    VELOCITY_YAW,
    Helm,
    SetPoint,
)
from agent.vehicle.link import AUTOPILOT, COMPANION, Link, Message, Tape
from agent.vehicle.safety import Limits, Timing
from agent.vehicle.state import VehicleState

log = logging.getLogger(__name__)

STREAMS = {32: 25.0, 30: 25.0, 33: 5.0, 245: 4.0, 1: 2.0, 24: 2.0}  # message -> Hz
HOME_POSITION = 242
REACHED = 0.4  # m below its height, a take-off becomes a set point
ASK_AGAIN = 1.0  # s between two attempts to arm
Place = tuple[float, float, float]  # m, local NED

CUSTOM = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


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
        TakenOverError: by every verb that moves it, while a person or the autopilot's failsafe
            flies it.
    """

    def __init__(
        self,
        connection: str,
        timing: Timing | None = None,
        limits: Limits | None = None,
        *,
        system: int = 0,
        key: bytes | None = None,
        record: Tape | None = None,
    ) -> None:
        self.timing, self.limits = timing or Timing(), limits or Limits()
        self.text, self.system = connection, system
        self._key, self._record = key, record
        self._helm = Helm(self.limits, self.timing, f"vehicle on {connection}")
        self._dialect: Dialect | None = None
        self._armed = False  # by us, and not yet seen on the ground again
        self._conversation: Conversation | None = None

    # -- life ----------------------------------------

    def __enter__(self) -> Self:
        link = Link(self.text, self.timing.connect, self.system, self._key, self._record)
        self._conversation = talk = Conversation(link, self.timing, self._steer)
        talk.name = f"vehicle on {self.text}"
        try:
            talk.await_(
                lambda s: s.heartbeat_at > 0, self.timing.connect, "sends nothing: no autopilot"
            )
            self.system, self._dialect = link.system, dialect_of(talk.state.autopilot)
            talk.name = f"vehicle {self.system} ({self._dialect.name})"
            talk.command("send its version", mavlink.MAV_CMD_REQUEST_MESSAGE, 148)
            for id_, rate in STREAMS.items():
                interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
                talk.command(f"stream message {id_}", interval, id_, 1e6 / rate)
        except BaseException:
            self.close()
            raise
        log.info("%s is on %s", talk.name, self.text)
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop talking.  A drone in the air then holds, as its autopilot does by itself."""
        if self._conversation is not None:
            self._conversation.close()

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
        return self._talk.state

    @property
    def broken_off(self) -> str | None:
        """Why safety has ended the flight; None while all is well."""
        return self._helm.broken or self._talk.ended or None

    @property
    def taken_over(self) -> str | None:
        """Who flies instead of us, and in which mode; None while we do, or before we did."""
        return self._helm.taken

    @property
    def ours(self) -> bool:
        """Whether we fly it, from arming to the landing: else leave it alone."""
        return self._helm.taken is None and (self._helm.steering or self._armed)

    @property
    def name(self) -> str:
        """What messages call it."""
        return self._talk.name

    @property
    def _talk(self) -> Conversation:
        if self._conversation is None:
            raise VehicleError(f"vehicle on {self.text} is not connected")
        return self._conversation

    # -- verbs ----------------------------------------

    def wait_ready(self) -> None:
        """Wait until the vehicle has a position and would arm."""
        self._talk.await_(
            lambda s: (
                time.monotonic() - s.position_at < self.timing.telemetry
                and s.prearm_ok is True
                and not math.isnan(s.altitude)
            ),
            self.timing.ready,
            "is not ready to arm",
        )

    def locate(self) -> Place:
        """Wait until it tells where it is [m, local NED], how it is turned, and whether it flies.

        Raises:
            VehicleError: it does not in time.
        """
        self._talk.await_(
            lambda s: (
                s.landed is not None
                and not math.isnan(s.attitude[2])
                and time.monotonic() - s.position_at < self.timing.telemetry
            ),
            self.timing.ready,
            "does not tell where it is",
        )
        return self.state.position

    def take_off(self, height: float) -> None:
        """Arm, climb to a height [m], and be ready for set points."""
        if not 0 < height <= self.limits.height:
            raise VehicleError(
                f"take-off to {height:g} m: expected more than 0, at most {self.limits.height:g}"
            )
        talk, dialect = self._talk, self.dialect
        if talk.rival:
            raise VehicleError(
                f"{self.name} has another companion (component {COMPANION}) on this link: "
                "expected to be the only one"
            )
        self.wait_ready()
        if self.state.landed is False:
            raise VehicleError(f"{self.name} is in the air: expected it on the ground")
        self.set_mode(dialect.before_arming)
        self._arm()
        talk.await_(lambda s: s.armed, self.timing.mode, "does not report that it is armed")
        start = self.state
        self._helm.home = start.position
        aim = height + (start.altitude if dialect.takeoff_above_sea else 0.0)
        nan = math.nan if dialect.takeoff_above_sea else 0.0
        talk.command("take off", mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan, nan, nan, aim)
        own = {dialect.before_arming, dialect.takeoff, dialect.guided, dialect.hold}
        talk.await_(
            lambda s: (
                abs(start.position[2] - s.position[2] - height) < REACHED
                or dialect.mode(s.custom_mode) not in own
            ),
            self.timing.takeoff,
            f"does not reach {height:g} m",
        )
        if (mode := dialect.mode(self.state.custom_mode)) not in own:
            self._helm.taken = f"{dialect.name_of(mode)}, chosen during the take-off"
            self._check_ours()
        x, y, z = start.position
        self._begin((x, y, z - height))

    def _arm(self) -> None:
        """Ask until it arms: what forbids it may pass, on PX4 as on ArduPilot."""
        end, told = time.monotonic() + self.timing.ready, False
        while True:
            try:
                self._talk.command("arm", mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            except RefusedError as refusal:
                if time.monotonic() > end:
                    raise VehicleError(f"{refusal}, for {self.timing.ready:g} s") from None
                if not told:
                    log.warning("%s: asking again for up to %g s", refusal, self.timing.ready)
                    told = True
                self._talk.pause(ASK_AGAIN)
            else:
                self._armed = True
                return

    def take_over(self) -> bool:
        """Go on with a drone that is in the air as a lost companion leaves it.

        Fence and height count from where the autopilot has its home, or, if it does not tell, from
        here.

        Returns:
            False where it stands on the ground.

        Raises:
            TakenOverError: it is in the air in another mode, so somebody else flies it.
        """
        self.locate()
        if self.state.landed:
            return False
        dialect = self.dialect
        mode = dialect.mode(self.state.custom_mode)
        abandoned = self.state.failsafe and mode in dialect.sticks  # it sinks; nobody steers
        if mode not in {dialect.hold, dialect.guided} and not abandoned:
            raise TakenOverError(
                f"{self.name} is flown by somebody else ({dialect.name_of(mode)}): "
                "expected it on the ground, or as a companion leaves it"
            )
        self._helm.home = self._ask_home()
        self.resume()
        return True

    def _ask_home(self) -> Place:
        """Where the autopilot has its home [m, local NED]; below us where it does not tell."""
        talk = self._talk
        try:
            talk.command("tell its home", mavlink.MAV_CMD_REQUEST_MESSAGE, HOME_POSITION)
            talk.await_(lambda s: s.home is not None, self.timing.mode, "does not tell its home")
        except VehicleError as error:
            log.warning("%s: fence and height count from here", error)
        return self.state.home or self.state.position

    def await_control(self) -> None:
        """Wait while somebody else flies, until our set points are obeyed again.

        Raises:
            VehicleError: the drone is landed and disarmed, or nobody gives it back in time.
        """
        begun = told = time.monotonic()
        while (taken := self._helm.taken) is not None:
            if not self.state.armed:
                self._release()
                raise VehicleError(f"{self.name} was landed by its pilot ({taken})")
            now = time.monotonic()
            if now - begun > self.timing.pilot:
                raise TakenOverError(f"{self.name} was not given back ({taken})")
            if now - told > self.timing.tell:
                told = now
                log.info("%s: waiting for its pilot for %.0f s (%s)", self.name, now - begun, taken)
            self._talk.pause(self.timing.stream)

    def fly_to(self, x: float, y: float, z: float, yaw: float) -> None:
        """Ask for a place [m, local NED] and a heading [rad]; returns at once."""
        place = self.limits.place_within(x, y, z, self._helm.home)
        self._wish(SetPoint(LOCAL_NED, POSITION_YAW, place, yaw=yaw))

    def fly_at(self, vx: float, vy: float, vz: float, yaw: float) -> None:
        """Ask for a velocity [m/s, NED] and a heading [rad]; returns at once."""
        velocity = self.limits.speed_within(vx, vy, vz)
        self._wish(SetPoint(LOCAL_NED, VELOCITY_YAW, velocity=velocity, yaw=yaw))

    def fly_ahead(self, forward: float, right: float, down: float, turn: float) -> None:
        """Ask for a velocity along the nose [m/s] and a yaw rate [rad/s]; returns at once."""
        velocity = self.limits.speed_within(forward, right, down)
        self._wish(SetPoint(BODY_NED, VELOCITY_RATE, velocity=velocity, turn=turn))

    def wait(self, condition: Callable[[VehicleState], bool], seconds: float, what: str) -> None:
        """Fly on until telemetry says so.

        Raises:
            VehicleError: it does not within `seconds`, or the flight is broken off.
            TakenOverError: somebody else flies.
        """
        self._talk.await_(
            lambda s: self.broken_off is not None or self._helm.taken is not None or condition(s),
            seconds,
            what,
        )
        self._check_flying()

    def hold(self) -> None:
        """Stand still, by the autopilot's own mode; set points stop until ``resume``."""
        self._release()
        self.set_mode(self.dialect.hold)

    def resume(self) -> None:
        """Obey set points again, after ``hold``; until one comes, stay here."""
        if self.broken_off is not None:
            raise VehicleError(f"{self.name}: flight broken off: {self.broken_off}")
        if not self.state.armed or self.state.landed:
            raise VehicleError(f"{self.name} has not taken off")
        self._begin()

    def land(self) -> None:
        """Land here, or see a broken-off flight to its end; returns when the rotors stand still.

        Raises:
            TakenOverError: somebody else flies it, now or before it is down.
        """
        self._check_ours()
        if self._helm.broken is None:
            self._release()
            self.set_mode(self.dialect.land)
        self._talk.await_(
            lambda s: (
                not s.armed
                or self._helm.taken is not None
                or time.monotonic() - s.heartbeat_at > self.timing.lost
            ),
            self.timing.land,
            "does not disarm after landing",
        )
        self._check_ours()
        if self.state.armed:
            raise VehicleError(f"{self.name} is not heard any more: it must land by itself")
        self._armed = False
        self._release()

    def disarm(self) -> None:
        """Stop the rotors; refused in the air."""
        self._release()
        self._talk.command("disarm", mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
        self._armed = False

    def set_mode(self, mode: Mode) -> None:
        """Enter a mode, and see that it is reported."""
        custom = self.dialect.custom_mode(mode)
        if self.state.custom_mode == custom:
            return
        name = f"enter mode {mode[0]}.{mode[1]}"
        self._talk.command(name, mavlink.MAV_CMD_DO_SET_MODE, CUSTOM, *mode)
        self._talk.await_(lambda s: s.custom_mode == custom, self.timing.mode, f"does not {name}")

    # -- the helm ----------------------------------------

    def _begin(self, place: Place | None = None) -> None:
        """Hold a place [m, local NED], or this one, by set points, and have them obeyed."""
        where = place or self.state.position
        here = SetPoint(LOCAL_NED, POSITION_YAW, where, yaw=self.state.attitude[2])
        with self._talk.lock:
            self._helm.begin(here, time.monotonic())
        if self.dialect.stream_first:  # at least half a second of them
            self._talk.pause(self.timing.stream * 10)
        self.set_mode(self.dialect.guided)
        with self._talk.lock:
            self._helm.wish(here, time.monotonic())
            self._helm.obeyed(self._talk.state, self.dialect)

    def _release(self) -> None:
        with self._talk.lock:
            self._helm.release()

    def _wish(self, setpoint: SetPoint) -> None:
        self._check_flying()
        with self._talk.lock:
            self._helm.wish(setpoint, time.monotonic())

    def _check_ours(self) -> None:
        if self._helm.taken is not None:
            raise TakenOverError(f"{self.name} is not ours to fly: {self._helm.taken}")

    def _check_flying(self) -> None:
        self._check_ours()
        if self.broken_off is not None:
            raise VehicleError(f"{self.name}: flight broken off: {self.broken_off}")
        if not self._helm.steering:
            raise VehicleError(
                f"{self.name} takes no set points: expected take_off or resume first"
            )

    def _steer(self, state: VehicleState, now: float) -> Message | None:
        """What the helm says, as a message."""
        order = None if self._dialect is None else self._helm.tick(state, self._dialect, now)
        if order is None:
            return None
        if isinstance(order, SetPoint):
            return mavlink.MAVLink_set_position_target_local_ned_message(
                max(state.time_boot_ms, 0), self.system, AUTOPILOT, order.frame, order.mask,
                *order.place, *order.velocity, 0.0, 0.0, 0.0, order.yaw, order.turn,
            )  # fmt: skip
        return mavlink.MAVLink_command_long_message(
            self.system, AUTOPILOT, mavlink.MAV_CMD_DO_SET_MODE, 0, CUSTOM, *order, 0, 0, 0, 0
        )
