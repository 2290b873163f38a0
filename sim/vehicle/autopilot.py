"""The autopilot: ``handle(message) -> replies`` and ``advance(seconds) -> telemetry``.

It owns the state (armed, mode, set point, home, battery) and decides what the quadrotor flies; it
has no socket, no thread and no clock: all timers run on simulation time, counted by ``advance``.
What differs between PX4 and ArduPilot is in ``flavours``, ``setpoints`` and ``parameters``, and
here where ``flavour.px4`` is asked.
"""

import math
from dataclasses import dataclass

import numpy as np

from sim.vehicle import guidance, inbox, setpoints, telemetry
from sim.vehicle.control import Speeds
from sim.vehicle.dialect import Message, mavlink
from sim.vehicle.flavours import Flavour, Mode
from sim.vehicle.frames import Doubles, Geodetic, geodetic_from_ned
from sim.vehicle.missions import MissionStore
from sim.vehicle.parameters import Limits, Parameters
from sim.vehicle.quadrotor import SLICE, Quadrotor
from sim.vehicle.telemetry import Streams, View

ZURICH = Geodetic(47.397742, 8.545594, 488.0)  # where PX4's simulated vehicles stand
CRASH = 3.0  # m/s; a harder touch ends the flight.  A guess
OFFBOARD_RATE = 0.5  # s; PX4 arms in OFFBOARD only with set points faster than 2 Hz
TAKEOFF_SPEED = 1.5  # m/s, PX4 MPC_TKO_SPEED
REACHED = 0.3  # m, a take-off or a way home that is this near is over


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
        self.heading = math.nan  # rad, asked for by CONDITION_YAW
        self.cruise: float | None = None  # m/s, asked for by DO_CHANGE_SPEED
        self.course = guidance.Course()  # how far the mission or the way home has got
        self._slices = 0
        self._armed_at = self._landed_at = 0.0
        self._flown = False  # since it was armed
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
        return self.body.on_ground

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
            armable=self._unready() is None,
            failsafe=self.failsafe,
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
        """Send a STATUSTEXT with the next answer."""
        self._outbox.append(mavlink.MAVLink_statustext_message(severity, text.encode()[:50]))

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

    def _unready(self) -> str | None:
        """What keeps the vehicle from arming, whatever its mode."""
        if not self.estimator:
            return "no position estimate yet"
        if self.battery <= self.parameters.limits.critical_battery:
            return f"battery {self.battery:.0%} too low"
        return None

    def arm(self) -> str | None:
        """Arm; or say why not."""
        if self.armed:
            return None
        reason = self._unready()
        if reason is None and not self.landed:
            reason = "not landed"
        if reason is None and self.flavour.px4 and self.mode is Mode.GUIDED:
            age = self.setpoint_age()
            if age > OFFBOARD_RATE:
                reason = "no offboard set points"
        if reason is None and self.mode in {Mode.LAND, Mode.RETURN}:
            reason = f"mode {self.mode.value} not armable"
        if reason is None and self.mode is Mode.MISSION and not self.missions.items:
            reason = "no mission"
        if reason is not None:
            head = "Arming denied" if self.flavour.px4 else "PreArm"
            self.say(f"{head}: {reason}", mavlink.MAV_SEVERITY_CRITICAL)
            return reason
        self.armed, self._flown, self.failsafe = True, False, False
        self._armed_at = self.now
        self.body.impact = 0.0
        self.home_ned = self.body.position
        self.hold = setpoints.hold_at(self.body.position)
        return None

    def disarm(self, *, force: bool = False) -> bool:
        """Stop the rotors; in the air only by force."""
        if self.armed and not self.landed and not force:
            self.say("Disarming denied: not landed", mavlink.MAV_SEVERITY_CRITICAL)
            return False
        self.armed, self.climb = False, None
        if self.flavour.px4 and self.mode is not Mode.MISSION:
            self._enter(Mode.HOLD)
        return True

    def setpoint_age(self) -> float:
        """Seconds since the last set point; infinite without one."""
        return math.inf if self.setpoint is None else self.now - self.setpoint.time

    def change_mode(self, mode: Mode, custom_mode: int | None = None) -> str | None:
        """Enter a mode (under the number that was asked for); or say why not."""
        if not self.estimator and mode is not Mode.MANUAL and not self.flavour.px4:
            return "no position estimate yet"
        if mode is Mode.MISSION and not self.missions.items:
            return "no mission"
        if mode is Mode.TAKEOFF and not self.armed:
            return "not armed"
        offboard = mode is Mode.GUIDED and self.flavour.px4
        if offboard and self.armed and self.setpoint_age() > OFFBOARD_RATE:
            return "no offboard set points"
        if mode is Mode.TAKEOFF:
            return self.take_off(self.parameters.limits.takeoff_height)
        if mode is not self.mode:
            self._enter(mode)
        if custom_mode is not None:
            self.custom_mode = custom_mode
        return None

    def _enter(self, mode: Mode) -> None:
        self.mode, self.climb, self.heading = mode, None, math.nan
        self.custom_mode = self.flavour.custom_mode(mode)
        self.course = guidance.Course()
        self.hold = setpoints.hold_at(guidance.stopping_point(self.body, self.parameters.limits))
        if not self.flavour.px4 and mode is Mode.GUIDED:
            self.setpoint = None  # older ones were for nobody

    def take_off(self, height: float) -> str | None:
        """Climb to a height above home [m]; or say why not."""
        if not self.armed:
            return "not armed"
        if not self.landed and self.flavour.px4 is False:
            return "already flying"
        limit = self.parameters.limits.fence_height
        if not 0 < height <= 1000 or (limit > 0 and height > limit):
            return f"height {height:.1f} m not allowed"
        if not self.flavour.px4 and self.mode is not Mode.GUIDED:
            return "take-off needs GUIDED"
        self._enter(Mode.TAKEOFF if self.flavour.px4 else Mode.GUIDED)
        self.climb = float(self.home_ned[2]) - height
        self.hold = setpoints.hold_at(self.body.position)
        return None

    def go_to(self, target: Doubles) -> str | None:
        """Hold at another place (DO_REPOSITION, a guided item); or say why not."""
        if not self.armed or self.landed:
            return "not flying"
        limits = self.parameters.limits
        kept = setpoints.confine(
            target, self.body.position, limits.fence_radius, limits.fence_height
        )
        if not np.allclose(kept[0:3], target[0:3]):
            return "beyond the fence"
        if self.flavour.px4:
            self._enter(Mode.HOLD)
            self.hold = target
        else:
            if self.mode is not Mode.GUIDED:
                self._enter(Mode.GUIDED)
            self.setpoint = SetPoint(target, self.now, moving=False)
        return None

    def place(self, position: Doubles, yaw: float) -> None:
        """Be in the air there, at rest, armed and guided: how a training flight begins."""
        x, y, z = (float(value) for value in position)
        self.body.place(x, y, z, yaw, flying=True)
        self.armed, self._flown, self.failsafe = True, True, False
        self._energy = 1.0
        self._enter(Mode.GUIDED)
        self.hold = setpoints.hold_at(position, yaw)
        self.setpoint = SetPoint(self.hold.copy(), self.now, moving=False)

    # -- time --------------------------------------------------------------------------------------

    def advance(self, seconds: float) -> list[Message]:
        """Let whole slices of 20 ms pass; what the vehicle says at their end."""
        for _ in range(round(seconds / SLICE)):
            self._watch()
            target, speeds = self._target()
            self.body.advance(target, speeds)
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

    def _watch(self) -> None:
        """Crash, battery, lost set points, automatic disarming."""
        if not self.armed:
            return
        limits = self.parameters.limits
        if self.body.impact > CRASH:
            self.say("Crash: disarming", mavlink.MAV_SEVERITY_EMERGENCY)
            self.failsafe = True
            self.disarm(force=True)
            return
        if not self.landed:
            self._flown, self._landed_at = True, self.now
        elif self.climb is None:
            waited = self.now - (self._landed_at if self._flown else self._armed_at)
            limit = limits.disarm_landed if self._flown else limits.disarm_waiting
            coming_down = self._flown and self.mode in {Mode.LAND, Mode.RETURN, Mode.MISSION}
            patience = limit if coming_down or self.flavour.px4 else limits.disarm_waiting
            if patience >= 0 and waited >= patience and not self._wants_up():
                self.say("Disarmed by landing" if self._flown else "Disarmed: no take-off")
                self.disarm()
                return
        if self.battery <= limits.critical_battery and self.mode is not Mode.LAND:
            self.say("Critical battery: landing", mavlink.MAV_SEVERITY_EMERGENCY)
            self.failsafe = True
            self._enter(Mode.LAND)
        offboard = self.mode is Mode.GUIDED and self.flavour.px4
        if offboard and self.setpoint_age() > limits.setpoint_timeout:
            self.say("Offboard set points lost", mavlink.MAV_SEVERITY_CRITICAL)
            action = {3: Mode.RETURN, 4: Mode.LAND}.get(int(self.parameters["COM_OBL_RC_ACT"]))
            self._enter(action or Mode.HOLD)

    def _wants_up(self) -> bool:
        """Whether what it flies leads off the ground."""
        if self.climb is not None or (self.mode is Mode.MISSION and not self.course.landing):
            return True
        if self.mode is not Mode.GUIDED or not self.flavour.px4 or self.setpoint is None:
            return False
        target = self.setpoint.target
        return bool(target[2] < self.body.position[2] - REACHED or target[5] < -0.1)

    def _target(self) -> tuple[Doubles | None, Speeds]:
        """What the body is to fly in this slice; None with the rotors off."""
        limits = self.parameters.limits
        wish = self.cruise or limits.cruise
        if self.mode is Mode.MISSION and not math.isnan(self.course.speed):
            wish = self.course.speed
        cruise = min(wish, limits.speed)
        speeds = Speeds(cruise, limits.up, limits.down)
        if not self.armed or (self.landed and not self._wants_up()):
            return None, speeds
        if self.climb is not None:
            target = self.hold.copy()
            target[2] = self.climb
            speeds = Speeds(cruise, min(TAKEOFF_SPEED, limits.up), limits.down)
            if abs(self.body.position[2] - self.climb) < REACHED:
                self._end_takeoff(target)
        elif self.mode is Mode.GUIDED and self.setpoint is not None:
            target = self._guided(self.setpoint)
            speeds = Speeds(limits.speed, limits.up, limits.down)
        elif self.mode is Mode.LAND:
            target = guidance.descend(self.hold, self.body, limits, self.home_ned)
        elif self.mode is Mode.RETURN:
            target = guidance.go_home(self.course, self.hold, self.body, limits, self.home_ned)
        elif self.mode is Mode.MISSION:
            target = self._fly_mission(limits)
        else:
            target = self.hold
        fenced = setpoints.confine(
            target, self.body.position, limits.fence_radius, limits.fence_height
        )
        if math.isnan(fenced[6]) and math.isnan(fenced[7]):
            fenced[6] = self.heading
        return fenced, speeds

    def _end_takeoff(self, target: Doubles) -> None:
        self.climb = None
        if self.flavour.px4:
            self._enter(Mode.HOLD)
        self.hold = target

    def _guided(self, setpoint: SetPoint) -> Doubles:
        """The set point; ArduPilot stands still where a velocity has become too old."""
        target = setpoint.target
        if not setpoint.moving or self.flavour.px4:
            return target
        if self.now - setpoint.time <= self.parameters.limits.setpoint_timeout:
            return target
        self.hold = setpoints.hold_at(guidance.stopping_point(self.body, self.parameters.limits))
        self.setpoint = None
        return self.hold

    def _fly_mission(self, limits: Limits) -> Doubles:
        around = guidance.Surroundings(
            self.now, limits, self.flavour, self.origin, self.home, self.home_ned
        )
        target, reached, over = guidance.fly_mission(
            self.course, self.missions, self.hold, self.body, around
        )
        for seq in reached:
            self._outbox.append(mavlink.MAVLink_mission_item_reached_message(seq))
        if reached:
            self._outbox.append(self.missions.current_message())
            self.hold = setpoints.hold_at(guidance.stopping_point(self.body, limits))
        if over and self.flavour.px4:
            self._enter(Mode.HOLD)
        return self.hold if over else target
