"""Writes moments to a Rerun stream, a column per entity and batch: what Rerun is fastest at."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise

import rerun as rr

from deploy.viewer.drawing import Scene
from deploy.viewer.moments import Moment
from deploy.viewer.rows import Row
from deploy.viewer.theory import Theory
from deploy.viewer.trails import Trail, flight_rows
from swarm.errors import SwarmError
from swarm.reports.telemetry import FlightSample

FLUSH = 20.0  # [s] for a viewer to take what it is sent, or to open its window first


class StreamBrokenError(SwarmError):
    """Nobody takes the data any more: the viewer was closed, the disk is full."""


class Recorder:
    """Takes moments in order, in batches of any size.

    Attributes:
        last: the newest moment taken.
    """

    def __init__(self, stream: rr.RecordingStream, scene: Scene) -> None:
        self._stream, self._scene, self.last = stream, scene, Moment()
        self._theory, self._trails = Theory.of(scene.config), defaultdict[str, Trail](Trail)
        for path, what in scene.still():
            stream.log(path, what, static=True)

    def take(self, moments: Sequence[Moment], samples: Sequence[FlightSample] = ()) -> None:
        """Write what these moments, and flight samples meanwhile, add.

        Raises:
            StreamBrokenError: it does not arrive.
        """
        tracks: dict[str, list[Row]] = {}
        for row in (*self._of_moments(moments), *self._of_flights(samples)):
            tracks.setdefault(row.path, []).append(row)
        for path, rows in tracks.items():
            times = [
                rr.TimeColumn("round", sequence=[row.round for row in rows]),
                rr.TimeColumn("time", timestamp=[row.time for row in rows]),
            ]
            self._stream.send_columns(path, times, rows[0].draw([row.value for row in rows]))
        self.last = moments[-1] if moments else self.last
        try:
            self._stream.flush(timeout_sec=FLUSH)
        except RuntimeError as error:
            raise StreamBrokenError(f"the recording has broken off: {error}") from None

    def _of_moments(self, moments: Sequence[Moment]) -> Iterator[Row]:
        for before, now in pairwise([self.last, *moments]):
            yield from self._scene.rows(before, now)
            yield from self._theory.rows(now)

    def _of_flights(self, samples: Sequence[FlightSample]) -> Iterator[Row]:
        for sample in samples:
            if sample.agent in self._scene.colours:
                colour = self._scene.colours[sample.agent]
                yield from flight_rows(sample, self._trails[sample.agent], colour)
