"""Flight samples that a run keeps: its worlds, paths and pictures can be seen when it is over.

Interface: :class:`FlightLog`, written by the agent, and :func:`read_flights`.  A file holds one
:class:`swarm.reports.telemetry.FlightSample` a line, as JSON with base64 for pictures.  A run keeps
at most :data:`SAMPLES` of each agent, spread evenly over its rounds, whatever its length: 10 MB,
for with its two pictures a sample of an indoor world has some 25 kB.
"""

import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from agent.storage.appender import Trouble
from agent.storage.files import write_file
from swarm.reports.telemetry import FLIGHT_RATE, FlightSample

SAMPLES = 400  # of each agent


class FlightLog:
    """The kept samples of one agent; writing them never stops a flight.

    Args:
        path: of the file; its folder is made with the first sample.
        begin: the round that comes next; samples of later ones are about to be made again.
        rounds: that the run plays.
        progress: how many of them the agent has played.
        clock: monotonic [s].
    """

    def __init__(
        self,
        path: Path,
        begin: int,
        rounds: int,
        progress: Callable[[], float],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._rounds, self._progress, self._clock = path, rounds, progress, clock
        self._earliest, self._trouble = -float("inf"), Trouble(clock=clock)
        samples = read_flights(path)
        kept = [sample for sample in samples if sample.round < begin]
        self._kept = len(kept)
        if len(kept) < len(samples):
            self._try(lambda: self._rewrite(kept))

    def flight_due(self) -> bool:
        """Whether a sample would be kept now; building one costs something."""
        share = SAMPLES * (self._progress() + 1) / self._rounds
        return self._clock() >= self._earliest and self._kept < min(share, SAMPLES)

    def flight(self, sample: FlightSample) -> None:
        """Keep a sample, if there is room on the disk."""
        self._earliest = self._clock() + 1 / FLIGHT_RATE
        self._kept += 1
        self._try(lambda: self._append(sample))

    def _append(self, sample: FlightSample) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("ab") as file:
            file.write(msgspec.json.encode(sample) + b"\n")

    def _rewrite(self, kept: list[FlightSample]) -> None:
        lines = b"".join(msgspec.json.encode(sample) + b"\n" for sample in kept)
        write_file(self._path, lines, durable=False)

    def _try(self, write: Callable[[], None]) -> None:
        try:
            write()
        except OSError as error:
            self._trouble.met(str(self._path), error)
        else:
            self._trouble.over(str(self._path))


def read_flights(path: Path) -> list[FlightSample]:
    """Samples of a file in order; none where there is no file; lines that do not read are none."""
    decoder = msgspec.json.Decoder(FlightSample)
    samples = []
    try:
        lines = path.read_bytes().splitlines()
    except OSError:
        return []
    for line in lines:
        try:
            samples.append(decoder.decode(line))
        except msgspec.MsgspecError:
            continue
    return samples
