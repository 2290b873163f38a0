"""Writes moments to a Rerun stream, a column per entity and batch: what Rerun is fastest at."""

from collections.abc import Sequence
from itertools import pairwise

import rerun as rr

from deploy.viewer.drawing import Row, Scene
from deploy.viewer.moments import Moment
from swarm.errors import SwarmError

FLUSH = 20.0  # [s] for a viewer to take what it is sent, or to open its window first


class StreamBrokenError(SwarmError):
    """Nobody takes the data any more: the viewer was closed, the disk is full."""


class Recorder:
    """Takes moments in order, in batches of any size."""

    def __init__(self, stream: rr.RecordingStream, scene: Scene) -> None:
        self._stream, self._scene, self._last = stream, scene, Moment()
        for path, what in scene.still():
            stream.log(path, what, static=True)

    def take(self, moments: Sequence[Moment]) -> None:
        """Write what these moments add.

        Raises:
            StreamBrokenError: it does not arrive.
        """
        tracks: dict[str, list[Row]] = {}
        for before, now in pairwise([self._last, *moments]):
            for row in self._scene.rows(before, now):
                tracks.setdefault(row.path, []).append(row)
        for path, rows in tracks.items():
            times = [
                rr.TimeColumn("round", sequence=[row.round for row in rows]),
                rr.TimeColumn("time", timestamp=[row.time for row in rows]),
            ]
            self._stream.send_columns(path, times, rows[0].draw([row.value for row in rows]))
        self._last = moments[-1] if moments else self._last
        try:
            self._stream.flush(timeout_sec=FLUSH)
        except RuntimeError as error:
            raise StreamBrokenError(f"the recording has broken off: {error}") from None
