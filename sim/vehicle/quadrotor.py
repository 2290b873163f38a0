"""One flying quadrotor: body, control, weather, sensors, and the world it may bump into.

Interface: :class:`Quadrotor`.  The world is a :class:`World`: how far a sphere may move, and what
is below; without one it is an open field, flat at z = 0.  The drone is a sphere that shrinks where
its legs come near to what is below: so it can land, also on a table.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sim.vehicle import airframe as parts
from sim.vehicle.control import MEMORY, TARGET, Speeds, coast, fly
from sim.vehicle.dynamics import SUBSTEP, at_rest
from sim.vehicle.frames import Doubles, euler_from_quaternion

SLICE = 0.02  # s, between two looks at the weather, the sensors and the walls
SLICE_STEPS = round(SLICE / SUBSTEP)


CLOSE = 0.01  # m, between the shrunken sphere and what the legs stand on


class World(Protocol):
    """Anything solid."""

    def reach(self, start: Doubles, move: Doubles, radius: float) -> float:
        """Share (0..1) of a straight `move` (3,) [m, NED] that a sphere can make; inf if all."""
        ...

    def floor(self, place: Doubles) -> float:
        """z of what is straight below a place (3,) [m, NED]."""
        ...


@dataclass(frozen=True)
class Weather:
    """Mean wind, and gusts as an Ornstein-Uhlenbeck process."""

    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m/s, velocity of the air, NED
    gusts: float = 0.0  # m/s, standard deviation per axis
    correlation: float = 2.0  # s, a guess


@dataclass(frozen=True)
class Noise:
    """How wrong the estimator is: slowly wandering errors (Ornstein-Uhlenbeck)."""

    position: float = 0.0  # m, standard deviation per axis
    velocity: float = 0.0  # m/s
    yaw: float = 0.0  # rad
    correlation: float = 5.0  # s, a guess


NOISY = Noise(position=0.15, velocity=0.05, yaw=0.02)  # a GPS receiver of the better sort; a guess


class Quadrotor:
    """Flies targets (see ``control``) through a world.  All times are simulation time."""

    def __init__(
        self,
        *,
        weather: Weather | None = None,
        noise: Noise | None = None,
        seed: int = 0,
        world: World | None = None,
        yaw: float = 0.0,
    ) -> None:
        """It stands at the origin, its nose towards `yaw` [rad]."""
        self.airframe, self.gains = parts.load()
        self.weather, self.noise = weather or Weather(), noise or Noise()
        self.world, self.ground = world, 0.0
        self._random = np.random.default_rng(seed)
        self._gust = np.zeros(3)
        self._belief = np.zeros(7)
        self._memory = np.zeros(MEMORY)
        self._stale = True  # the memory belongs to another flight
        self.impact = 0.0  # m/s, of the hardest touch since the last take-off
        self.touching = False  # the way was barred in the last slice
        self.place(0.0, 0.0, -self.airframe.legs, yaw, flying=False)

    # -- what the autopilot's sensors say ----------------------------------------------------------

    @property
    def position(self) -> Doubles:
        """(3,) [m, NED], as estimated."""
        return np.asarray(self.state[0:3] + self._belief[0:3])

    @property
    def velocity(self) -> Doubles:
        """(3,) [m/s, NED], as estimated."""
        return np.asarray(self.state[3:6] + self._belief[3:6])

    @property
    def attitude(self) -> tuple[float, float, float]:
        """Roll, pitch, yaw [rad], as estimated."""
        roll, pitch, yaw = euler_from_quaternion(self.state[6:10])
        return roll, pitch, yaw + float(self._belief[6])

    @property
    def rates(self) -> Doubles:
        """(3,) [rad/s, FRD]."""
        return self.state[10:13]

    @property
    def thrust(self) -> float:
        """Share of the full thrust, 0 to 1."""
        return float(self.state[13:17].sum()) / (4 * self.airframe.rotor_thrust)

    @property
    def on_ground(self) -> bool:
        return bool(self.state[2] >= self.ground - self.airframe.legs - 1e-6)

    # -- what happens to it ------------------------------------------------------------------------

    def place(self, x: float, y: float, z: float, yaw: float, *, flying: bool) -> None:
        """Be there, level and at rest; flying: with rotors that carry the weight."""
        hover = self.airframe.mass * self.airframe.gravity / 4
        self.state = at_rest(x, y, z, yaw, hover if flying else 0.0)
        self._memory[:] = 0.0, 0.0, 0.0, yaw
        self._gust[:] = 0.0
        self._belief[:] = 0.0
        self._stale, self.impact, self.touching = not flying, 0.0, False

    def reseed(self, seed: int) -> None:
        """Draw gusts and the estimator's errors from another seed from now on."""
        self._random = np.random.default_rng(seed)

    @property
    def truth(self) -> tuple[Doubles, Doubles]:
        """Where it really is (3,) [m, NED], and its attitude as a quaternion (4,), w first."""
        return self.state[0:3], self.state[6:10]

    def advance(self, target: Doubles | None, speeds: Speeds, slices: int = 1) -> None:
        """Fly `slices` of 20 ms towards a target (8,); with None the rotors are off."""
        if target is None:
            self._stale = True
        elif self._stale:
            self._memory[:] = 0.0, 0.0, 0.0, self.attitude[2]
            self._stale = False
        for _ in range(slices):
            self._weather_and_sensors()
            start = self.state[0:3].copy()
            if self.world is not None:
                self.ground = self.world.floor(start)
            air = self._gust + self.weather.wind
            if target is None:
                hit = coast(self.state, air, self.ground, self.airframe, SLICE_STEPS)
            else:
                assert target.shape == (TARGET,)
                hit = fly(
                    self.state, target, self._memory, self._belief, air, self.ground,
                    self.airframe, self.gains, speeds, SLICE_STEPS,
                )  # fmt: skip
            self.impact = max(self.impact, hit)
            if self.world is not None:
                self._meet(self.world, start)

    def _meet(self, world: World, start: Doubles) -> None:
        """Stop where the way is barred; the speed at which it was met is an impact."""
        move = self.state[0:3] - start
        low = self.ground - max(start[2], self.state[2])  # above what is below
        radius = min(self.airframe.radius, max(low, self.airframe.legs) - CLOSE)
        share = world.reach(start, move, radius)
        self.touching = share <= 1.0
        if not self.touching:
            return
        self.impact = max(self.impact, float(np.linalg.norm(self.state[3:6])))
        self.state[0:3] = start + share * move
        self.state[3:6] = 0.0
        self.state[10:13] = 0.0

    def _weather_and_sensors(self) -> None:
        """Let the gusts and the estimator's errors wander by one slice."""
        if self.weather.gusts > 0:
            _wander(self._random, self._gust, self.weather.gusts, self.weather.correlation)
        noise = self.noise
        if noise.position > 0:
            _wander(self._random, self._belief[0:3], noise.position, noise.correlation)
        if noise.velocity > 0:
            _wander(self._random, self._belief[3:6], noise.velocity, noise.correlation)
        if noise.yaw > 0:
            _wander(self._random, self._belief[6:7], noise.yaw, noise.correlation)


def _wander(random: np.random.Generator, value: Doubles, deviation: float, tau: float) -> None:
    """One exact step of an Ornstein-Uhlenbeck process, in place."""
    keep = np.exp(-SLICE / tau)
    value *= keep
    value += deviation * np.sqrt(1 - keep * keep) * random.standard_normal(value.shape)
