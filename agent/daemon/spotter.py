"""Lets whoever watches see an agent's drone: its way, and now and then what it sees.

Interface: :class:`Spotter`, whose :meth:`~Spotter.see` a learner calls after every step of its
first world.  Worlds that tell no pose (``info["pose"]``: x, y, z [m, NED], roll, pitch, yaw [rad])
are not shown.  Pictures are made only when one would be sent.
"""

import time
from collections import deque
from collections.abc import Callable

import numpy as np

from agent.daemon.pictures import png_of_depth, png_of_rgb
from agent.learning.learner import Moment
from swarm.reports.telemetry import TRACK, FlightSample, TelemetryPublisher

Place = tuple[float, float, float]


class Spotter:
    """Collects the way and sends samples.

    Args:
        agent: id.
        telemetry: where to.
        round_: tells the round under way.
    """

    def __init__(
        self, agent: str, telemetry: TelemetryPublisher, round_: Callable[[], int]
    ) -> None:
        self._agent, self._telemetry, self._round = agent, telemetry, round_
        self._way: deque[Place] = deque(maxlen=TRACK)
        self._flight = 0

    def see(self, moment: Moment) -> None:
        """Take note of a step; send a sample if one is due."""
        pose = moment.info.get("pose")
        if pose is None:
            return
        if moment.flight != self._flight:
            self._flight = moment.flight
            self._way.clear()
        place = (float(pose[0]), float(pose[1]), float(pose[2]))
        self._way.append(place)
        if not self._telemetry.flight_due():
            return
        picture, depth = moment.observation, getattr(moment.env.unwrapped, "depth", None)
        seen = picture.dtype == np.uint8 and picture.shape[2:] == (3,)
        self._telemetry.flight(
            FlightSample(
                agent=self._agent,
                round=self._round(),
                time=time.time(),
                flight=moment.flight,
                step=moment.step,
                position=place,
                yaw=float(pose[5]),
                action=moment.action,
                reward=moment.reward,
                distance=float(moment.info.get("distance", 0.0)),
                track=tuple(self._way),
                camera=png_of_rgb(picture) if seen else b"",
                depth=b"" if depth is None else png_of_depth(depth),
            )
        )
        self._way.clear()
