"""``body="mavlink"``: the full vehicle in the loop of ``IndoorFlight-v0``, in lockstep over UDP.

Interface: :func:`lockstep_bodies`.  An environment has one process of vehicles, a child of the
environment's own; each of its flights has one vehicle in it, with a system id and a port of its
own.  A step asks for the velocity that leads to the set point in the time of a step, and for its
heading, as far as the vehicle's estimates are true; camera, collision and distance follow where it
really gets, with its inertia and tilt.
"""

from collections.abc import Sequence

from sim.indoor.flight.body import Body, Pose, SetPoint, Site
from sim.vehicle.flavours import FLAVOURS
from sim.vehicle.fleet import VehicleProcess, start_all
from sim.vehicle.lockstep import LockstepClient
from sim.vehicle.quadrotor import NOISY, Noise, Weather
from sim.vehicle.server import Options

STEP = 0.4  # s: at 1 m/s one step of the environment


class LockstepBody:
    """One vehicle of a process; the last one that is closed ends the process."""

    def __init__(
        self, client: LockstepClient, home: Pose, step: float, process: VehicleProcess
    ) -> None:
        self._client, self._home, self._step, self._process = client, home, step, process
        self._closed = False

    @property
    def pose(self) -> Pose:
        """Where it really is, in the frame of the scene."""
        state, home = self._client.connect(), self._home
        x, y, z = state.true_position
        return Pose(x + home.x, y + home.y, z + home.z, *state.true_attitude)

    def place(self, pose: Pose, seed: int) -> None:
        """Be there in the air, level and at rest; takes no time."""
        home = self._home
        self._client.place(pose.x - home.x, pose.y - home.y, pose.z - home.z, pose.yaw, seed)

    def head_for(self, target: SetPoint) -> None:
        """Send the set point of a step, as one who believes the vehicle's estimates."""
        state, home, seconds = self._client.connect(), self._home, self._step
        x, y, z = state.position
        self._client.send_velocity(
            (target.x - home.x - x) / seconds,
            (target.y - home.y - y) / seconds,
            (target.z - home.z - z) / seconds,
            target.yaw,
        )

    def arrive(self) -> None:
        """Wait for the telemetry of the step."""
        self._client.finish()

    def close(self) -> None:
        """Let go of socket and process."""
        if not self._closed:
            self._closed = True
            self._client.close()
            self._process.release()


def lockstep_bodies(
    sites: Sequence[Site],
    *,
    flavour: str = "px4",
    step: float = STEP,
    system: int = 1,
    solid: bool = True,
    wind: Sequence[float] = (0.0, 0.0),
    gusts: float = 0.0,
    noise: bool = False,
) -> list[Body]:
    """One vehicle for each site, in a process of their own.

    Args:
        sites: where they fly.
        flavour: whose behaviour they have, ``"px4"`` or ``"ardupilot"``.
        step: simulated time of a step [s]; twice as long, half as fast.
        system: system id of the first.
        solid: whether the vehicle itself feels the walls; the environment's collision does anyway.
        wind: where the air goes, north and east [m/s].
        gusts: standard deviation of the wind per axis [m/s].
        noise: whether the estimator errs; the vehicle then steers by what it believes.

    Gusts and noise are drawn from the seed of each flight (``reset(seed=...)``).

    Raises:
        ValueError: an option is none.
        VehicleLostError: the vehicles do not start.
    """
    if flavour not in FLAVOURS:
        raise ValueError(f'flavour "{flavour}": expected one of {", ".join(FLAVOURS)}')
    if len(wind) != 2:
        raise ValueError(f"wind = {wind}: expected two numbers, north and east [m/s]")
    weather = Weather((float(wind[0]), float(wind[1]), 0.0), gusts)
    options = [
        Options(
            system=system + site.flight,
            flavour=FLAVOURS[flavour],
            lockstep=step,
            weather=weather,
            noise=NOISY if noise else Noise(),
            scene=site.scene if solid else None,
        )
        for site in sites
    ]
    process, clients = start_all(options)
    return [
        LockstepBody(client, site.home, step, process)
        for client, site in zip(clients, sites, strict=True)
    ]
