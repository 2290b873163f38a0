"""Shows an agent's drone to others: its way, and now and then what it sees.

Interface: :class:`Spotter`, whose :meth:`~Spotter.see` a learner calls after every step of its
first world, and :class:`Audience`: who watches now, and the run folder for those who come later.
Worlds that tell no pose (``info["pose"]``: x, y, z [m, NED], roll, pitch, yaw [rad]) are not shown.
Pictures are made only when somebody would get one.
"""

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from agent.daemon.pictures import png_of_depth, png_of_rgb
from agent.learning.learner import Moment
from swarm.reports.telemetry import TRACK, FlightSample

Place = tuple[float, float, float]


class Audience(Protocol):
    """Takes samples, at a rate of its own."""

    def flight_due(self) -> bool:
        """Whether it wants one now."""
        ...

    def flight(self, sample: FlightSample) -> None:
        """Take one."""
        ...


class Spotter:
    """Collects the way since each audience's last sample, and hands samples on.

    Args:
        agent: id.
        round_: tells the round under way.
        audiences: who gets samples.
    """

    def __init__(self, agent: str, round_: Callable[[], int], *audiences: Audience) -> None:
        self._agent, self._round = agent, round_
        self._ways: list[tuple[Audience, list[Place]]] = [(a, []) for a in audiences]
        self._flight = 0

    def see(self, moment: Moment) -> None:
        """Take note of a step; hand out a sample where one is due."""
        pose = moment.info.get("pose")
        if pose is None:
            return
        if moment.flight != self._flight:
            self._flight = moment.flight
            for _, way in self._ways:
                way.clear()
        place = (float(pose[0]), float(pose[1]), float(pose[2]))
        camera = depth = None
        for audience, way in self._ways:
            way.append(place)
            if len(way) > TRACK:
                del way[1:-1:2]  # every second place, not the ends
            if not audience.flight_due():
                continue
            if camera is None or depth is None:
                camera, depth = _pictures(moment)
            audience.flight(
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
                    track=tuple(way),
                    camera=camera,
                    depth=depth,
                )
            )
            way.clear()


def _pictures(moment: Moment) -> tuple[bytes, bytes]:
    """What the drone sees, and how far that is; empty where its world does not tell."""
    picture, depth = moment.observation, getattr(moment.env.unwrapped, "depth", None)
    seen = picture.dtype == np.uint8 and picture.shape[2:] == (3,)
    return png_of_rgb(picture) if seen else b"", b"" if depth is None else png_of_depth(depth)
