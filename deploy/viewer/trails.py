"""What flight samples add to a recording.

======================  ====================================================================
``worlds/{agent}``      ``flights``: paths of the flights watched last, the newest bright;
                        ``drone``: an arrow along its nose
``sight/{agent}``       ``camera`` and ``depth``: what it sees
``action/{agent}``      what it did
``reward/{agent}``      what it got for that
======================  ====================================================================
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from deploy.viewer.colours import Colour
from deploy.viewer.rows import Columns, Row, scalars
from swarm.reports.telemetry import FlightSample

NOSE = 1.5  # [m] length of the arrow
FLIGHTS = 6  # paths that are shown of each drone
POINTS = 300  # most places of a path that are drawn
DIM = 0.45  # brightness of earlier paths
LARGE = 1.0  # [s] between paths, and pictures, of a drone: an hour of four stays under 1 GB

Path = NDArray[np.float32]  # (n, 3) [m, NED]


class Paths(NamedTuple):
    """Paths of one drone and their colours."""

    paths: list[Path]
    colours: list[Colour]


class Arrow(NamedTuple):
    """A drone: where it is, and where its nose points [m, NED]."""

    position: tuple[float, float, float]
    nose: tuple[float, float, float]


@dataclass(slots=True)
class Trail:
    """Where one drone has flown, as far as its samples tell.

    Attributes:
        flight: number of the flight under way; None before the first.
        paths: of the last flights, the one under way at the end.
        drawn: time of the last paths and pictures [Unix s].
    """

    flight: int | None = None
    paths: deque[list[tuple[float, float, float]]] = field(
        default_factory=lambda: deque(maxlen=FLIGHTS)
    )
    drawn: float = 0.0

    def take(self, sample: FlightSample) -> list[list[tuple[float, float, float]]]:
        """Add a sample; returns all paths, thinned evenly where they have too many places."""
        if sample.flight != self.flight:
            self.flight = sample.flight
            self.paths.append([])
        path = self.paths[-1]
        for place in (*sample.track, sample.position):
            if not path or place != path[-1]:
                path.append(place)
        while len(path) > POINTS:
            del path[1:-1:2]  # every second one, not the ends
        return list(self.paths)


def flight_rows(sample: FlightSample, trail: Trail, colour: Colour) -> Iterator[Row]:
    """What a sample adds; its drone's ``trail`` grows by it."""
    agent, at = sample.agent, (sample.round, sample.time)
    paths = trail.take(sample)
    nose = (NOSE * float(np.cos(sample.yaw)), NOSE * float(np.sin(sample.yaw)), 0.0)
    yield Row(f"worlds/{agent}/drone", arrows, *at, Arrow(sample.position, nose))
    yield Row(f"action/{agent}", scalars, *at, float(sample.action))
    yield Row(f"reward/{agent}", scalars, *at, sample.reward)
    if sample.time < trail.drawn + LARGE:
        return
    trail.drawn = sample.time
    red, green, blue = colour
    dim = (int(red * DIM), int(green * DIM), int(blue * DIM))
    shades = [dim] * (len(paths) - 1) + [colour]
    shown = [np.array(path, np.float32) for path in paths]
    yield Row(f"worlds/{agent}/flights", strips, *at, Paths(shown, shades))
    if sample.camera:
        yield Row(f"sight/{agent}/camera", pictures, *at, sample.camera)
    if sample.depth:
        yield Row(f"sight/{agent}/depth", depths, *at, sample.depth)


def still(agents: Mapping[str, Colour]) -> Iterator[tuple[str, rr.AsComponents]]:
    """What is logged once: entity and data."""
    for agent, colour in agents.items():
        yield f"sight/{agent}/depth", rr.EncodedDepthImage.from_fields(meter=1000.0)
        for plot in ("action", "reward"):
            yield f"{plot}/{agent}", rr.SeriesPoints(names=[agent], colors=[colour])


def strips(values: Sequence[Paths]) -> Columns:
    """Paths a row."""
    counts = [len(value.paths) for value in values]
    return [
        *rr.LineStrips3D.columns(
            strips=[path for value in values for path in value.paths],
            colors=[colour for value in values for colour in value.colours],
        ).partition(counts)
    ]


def arrows(values: Sequence[Arrow]) -> Columns:
    """A drone a row."""
    return [
        *rr.Arrows3D.columns(
            origins=[value.position for value in values], vectors=[value.nose for value in values]
        )
    ]


def pictures(values: Sequence[Any]) -> Columns:
    """An encoded picture a row."""
    return [*rr.EncodedImage.columns(blob=values, media_type=[kind(v) for v in values])]


def depths(values: Sequence[Any]) -> Columns:
    """An encoded depth image a row."""
    return [*rr.EncodedDepthImage.columns(blob=values, media_type=["image/png"] * len(values))]


def kind(picture: bytes) -> str:
    """Media type of an encoded picture."""
    return "image/png" if picture.startswith(b"\x89PNG") else "image/jpeg"
