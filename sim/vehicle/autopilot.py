"""The autopilot: ``handle(message) -> replies`` and ``advance(seconds) -> telemetry``.

It owns the state (armed, mode, set point, home, battery); it has no socket, no thread and no clock:
all timers run on simulation time, counted by ``advance``.  What it does stands in ``inbox`` and
``commands`` (what is asked of it), ``arming``, ``steering`` (what is flown) and ``watch`` (what it
looks after by itself).  What differs between PX4 and ArduPilot is in ``flavours``, ``setpoints``
and ``parameters``, and wherever ``flavour.px4`` is asked.
"""

import math
from dataclasses import dataclass

import numpy as np

from sim.vehicle import guidance, inbox, setpoints, telemetry
from sim.vehicle.arming import OFFBOARD_RATE, Sortie, unready
from sim.vehicle.control import Speeds
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import POSITION_CONTROL, Flavour, Mode
from sim.vehicle.frames import Doubles, Geodetic, geodetic_from_ned
from sim.vehicle.missions import MissionStore
from sim.vehicle.parameters import Parameters
from sim.vehicle.quadrotor import SLICE, Quadrotor
from sim.vehicle.steering import steer
from sim.vehicle.telemetry import Streams, View
from sim.vehicle.watch import watch

FENCE_MARGIN = 2.0  # m, ArduPilot's FENCE_MARGIN: it stops that far inside
ZURICH = Geodetic(47.397742, 8.545594, 488.0)  # where PX4's simulated vehicles stand


@dataclass
class SetPoint:
    """The last one that was accepted."""

    target: Doubles  # (8,) see ``control``
    time: float  # s, when it came
    moving: bool  # it asks for velocities and no position


class Autopilot:
    """One vehicle's autopilot.

    Args:
        body: what it flies.
        flavour: whose behaviour it has.
        system: its MAVLink system id; the component is 1.
        origin: where the local frame's origin is.
        lockstep: telemetry flows from the start, and a vehicle may be placed by command.
    """

    def __init__(
        self,
        body: Quadrotor,
        flavour: Flavour,
        *,
        system: int = 1,
        origin: Geodetic = ZURICH,
        lockstep: bool = False,
    ) -> None:
        self.body, self.flavour, self.lockstep = body, flavour, lockstep
        self.system, self.component = system, mavlink.MAV_COMP_ID_AUTOPILOT1
        self.parameters = Parameters(flavour, system)
        self.missions = MissionStore(flavour)
        self.streams = Streams(running=flavour.streams_at_start or lockstep)
        if lockstep:
            for id_ in (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_ATTITUDE):
                self.streams.every(id_, SLICE, 0.0)
        self.origin = origin
        self.now = 0.0
        self.armed = False
        self.mode = flavour.first_mode
        self.custom_mode = flavour.custom_mode(self.mode)  # several numbers may mean one mode
        self.failsafe = False
        self.home_ned = np.array([0.0, 0.0, body.position[2]])
        self.hold: Doubles = setpoints.hold_at(body.position)
        self.setpoint: SetPoint | None = None
        self.climb: float | None = None  # z of the take-off under way [m]
        self.takeoff_height = self.parameters.limits.takeoff_height  # m, of the one asked for
        self.heading = math.nan  # rad, asked for by CONDITION_YAW
        self.cruise: float | None = None  # m/s, asked for by DO_CHANGE_SPEED
        self.course = guidance.Course()  # how far the mission or the way home has got
        self.sortie = Sortie()
        self._slices = 0
        self._texts = 0  # STATUSTEXTs so far
        self._energy = 1.0
        self._outbox: list[Message] = []

    # -- what others see ---------------------------------------------------------------------------

    @property
    def ms(self) -> int:
        """time_boot_ms."""
        return round(self.now * 1000)

    @property
    def estimator(self) -> bool:
        """Whether the estimator has a position."""
        return self.lockstep or self.now >= self.flavour.estimator_seconds

    @property
    def landed(self) -> bool:
        """On the ground, or at rest on something else."""
        return self.body.on_ground or (not self.armed and self.body.touching)

    @property
    def sinking(self) -> bool:
        """Set points stopped on PX4: it reports position control, and comes down all the way."""
        return self.mode is Mode.LAND and self.flavour.px4 and self.custom_mode == POSITION_CONTROL

    @property
    def battery(self) -> float:
        """Share that is left."""
        return max(self._energy, self.parameters["SIM_BAT_MIN_PCT"] / 100)

    @property
    def home(self) -> Geodetic:
        return geodetic_from_ned(self.origin, *self.home_ned)

    @property
    def landed_state(self) -> int:
        """MAV_LANDED_STATE."""
        if self.landed:
            return int(mavlink.MAV_LANDED_STATE_ON_GROUND)
        if self.climb is not None:
            return int(mavlink.MAV_LANDED_STATE_TAKEOFF)
        if self.mode is Mode.LAND or self.course.landing:
            return int(mavlink.MAV_LANDED_STATE_LANDING)
        return int(mavlink.MAV_LANDED_STATE_IN_AIR)

    @property
    def idle_speeds(self) -> Speeds:
        """What it may do by its parameters alone."""
        limits = self.parameters.limits
        return Speeds(limits.speed, limits.up, limits.down)

    def view(self) -> View:
        """What telemetry is made of."""
        return View(
            flavour=self.flavour,
            now=self.now,
            armed=self.armed,
            mode=self.mode,
            custom_mode=self.custom_mode,
            landed_state=self.landed_state,
            position=self.body.position,
            velocity=self.body.velocity,
            attitude=self.body.attitude,
            rates=self.body.rates,
            thrust=self.body.thrust,
            origin=self.origin,
            home=self.home,
            home_ned=self.home_ned,
            battery=self.battery,
            estimator=self.estimator,
            armable=unready(self) is None,
            failsafe=self.failsafe,
            system=self.system,
        )

    def message(self, id_: int) -> Message | None:
        """A message by its number; None where there is none (now)."""
        if id_ == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
            return self.missions.current_message()
        builder = telemetry.BUILDERS.get(id_)
        return builder(self.view()) if builder is not None else None

    def send(self, *messages: Message) -> None:
        """Send messages with the next answer."""
        self._outbox += messages

    def say(self, text: str, severity: int = mavlink.MAV_SEVERITY_INFO) -> None:
        """Send a STATUSTEXT with the next answer, in chunks of 50 bytes."""
        data = text.encode()
        self._texts = self._texts % 0xFFFF + 1
        for chunk, start in enumerate(range(0, len(data), 50)):
            self._outbox.append(
                mavlink.MAVLink_statustext_message(
                    severity, data[start : start + 50], self._texts if len(data) > 50 else 0, chunk
                )
            )

    # -- messages in -------------------------------------------------------------------------------

    def handle(self, message: Message) -> list[Message]:
        """Act on one message; the replies to it."""
        inbox.sort(self, message)
        replies, self._outbox = self._outbox, []
        return replies

    def take(self, target: Doubles | None) -> None:
        """A set point: remember it; it moves the vehicle only in GUIDED."""
        if target is None or not self.estimator:
            return
        if self.mode is Mode.GUIDED and not self.flavour.px4 and self.climb is not None:
            self.climb = None
            self.say("Takeoff aborted by set point", mavlink.MAV_SEVERITY_WARNING)
        self.setpoint = SetPoint(target, self.now, bool(np.isnan(target[0:3]).all()))

    # -- what may be done, and doing it ------------------------------------------------------------

    def setpoint_age(self) -> float:
        """Seconds since the last set point; infinite without one."""
        return math.inf if self.setpoint is None else self.now - self.setpoint.time

    def change_mode(self, mode: Mode, custom_mode: int | None = None) -> str | None:
        """Enter a mode (under the number that was asked for); or say why not."""
        if not self.estimator and mode is not Mode.MANUAL and not self.flavour.px4:
            return "no position estimate yet"
        if mode is Mode.MISSION and self.armed and not self.missions.items:
            return "no mission"
        offboard = mode is Mode.GUIDED and self.flavour.px4
        if offboard and self.armed and self.setpoint_age() > OFFBOARD_RATE:
            return "no offboard set points"
        if mode is Mode.TAKEOFF:
            return self.take_off(self.parameters.limits.takeoff_height)
        if mode is not self.mode:
            self.enter(mode)
        if custom_mode is not None:
            self.custom_mode = custom_mode
        return None

    def enter(self, mode: Mode) -> None:
        """Be in a mode, without asking whether that is allowed."""
        self.mode, self.climb, self.heading = mode, None, math.nan
        self.custom_mode = self.flavour.custom_mode(mode)
        self.course = guidance.Course()
        self.hold = setpoints.hold_at(guidance.stopping_point(self.body, self.parameters.limits))
        if not self.flavour.px4 and mode is Mode.GUIDED:
            self.setpoint = None  # older ones were for nobody

    def take_off(self, height: float) -> str | None:
        """Climb to a height above home [m]; or say why not."""
        if not self.armed and not self.flavour.px4:
            return ""
        if not self.landed and self.flavour.px4 is False:
            return "already flying"
        limit = self.parameters.limits.fence_height
        if not 0 < height <= 1000 or (limit > 0 and height > limit):
            return f"height {height:.1f} m not allowed"
        if not self.flavour.px4 and self.mode is not Mode.GUIDED:
            return "take-off needs GUIDED"
        self.enter(Mode.TAKEOFF if self.flavour.px4 else Mode.GUIDED)
        self.takeoff_height = height
        self.climb = float(self.home_ned[2]) - height if self.armed else None
        self.hold = setpoints.hold_at(self.body.position)
        return None

    def go_to(self, target: Doubles) -> str | None:
        """Hold at another place (DO_REPOSITION, a guided item); or say why not."""
        if not self.armed or self.landed:
            return "not flying"
        limits = self.parameters.limits
        kept = setpoints.confine(
            target, self.body.position, self.home_ned, limits.fence_radius, limits.fence_height
        )
        if not np.allclose(kept[0:3], target[0:3]):
            return "beyond the fence"
        if self.flavour.px4:
            self.enter(Mode.HOLD)
            self.hold = target
        else:
            if self.mode is not Mode.GUIDED:
                self.enter(Mode.GUIDED)
            self.setpoint = SetPoint(target, self.now, moving=False)
        return None

    def confine(self, target: Doubles) -> Doubles:
        """The target (8,) inside the fence; on PX4 the fence acts when it is broken (``watch``)."""
        limits = self.parameters.limits
        radius = limits.fence_radius
        if self.flavour.px4:
            radius = 0.0
        elif radius > 0:
            radius = max(radius - FENCE_MARGIN, 0.1)
        return setpoints.confine(
            target, self.body.position, self.home_ned, radius, limits.fence_height
        )

    def place(self, position: Doubles, yaw: float) -> None:
        """Be in the air there, at rest, armed and guided: how a training flight begins."""
        x, y, z = (float(value) for value in position)
        self.body.place(x, y, z, yaw, flying=True)
        self.armed, self.failsafe = True, False
        self.sortie = Sortie(armed_at=self.now, landed_at=self.now, flown=True)
        self._energy = 1.0
        self.enter(Mode.GUIDED)
        self.hold = setpoints.hold_at(position, yaw)
        self.setpoint = SetPoint(self.hold.copy(), self.now, moving=False)

    # -- time --------------------------------------------------------------------------------------

    def advance(self, seconds: float) -> list[Message]:
        """Let whole slices of 20 ms pass; what the vehicle says at their end."""
        for _ in range(round(seconds / SLICE)):
            watch(self)
            self.body.advance(*steer(self))
            self._slices += 1
            self.now = self._slices * SLICE
            if self.armed:
                self._energy -= SLICE / self.parameters["SIM_BAT_DRAIN"]
        out, self._outbox = self._outbox + self.missions.advance(self.now), []
        due = self.streams.due(self.now)
        if due:
            view = self.view()
            for id_ in due:
                if id_ == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
                    out.append(self.missions.current_message())
                elif (message := telemetry.BUILDERS[id_](view)) is not None:
                    out.append(message)
        return out
