"""A session of the viewer: whence moments come, and for how long.

From a run folder, a session shows what it holds.  Attached to a running swarm, it begins with what
the agents remember (:mod:`swarm.reports.history`) and goes on with what they publish; a session
that somebody looks at waits for a swarm that goes away, and goes on when it is back.
"""

import queue
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from agent.config.experiment import SwarmFile
from agent.storage.flights import read_flights
from agent.storage.runfolder import RunFolder
from deploy.observe.status import Target, observe
from deploy.process.news import working
from deploy.process.signals import stop_meanwhile
from deploy.viewer.moments import Moment, history, remembered
from deploy.viewer.outputs import Output, opened
from deploy.viewer.recorder import Recorder
from swarm.errors import ConfigError, NetworkError
from swarm.reports.history import ask_history
from swarm.reports.telemetry import FlightSample, RoundReport, watch_flights, watch_reports
from swarm.wire.keys import Keys
from swarm.wire.roster import Roster

LOOK = 3.0  # [s] for somebody to be seen
RECALL = 2.0  # [s] for the agents to tell what they remember
TICK = 0.5  # [s] between moments
BATCH = 20  # moments that go to a file together: a column costs 1 kB, however short
GONE = 2.0  # [s] without anybody: the swarm has ended


@dataclass(slots=True)
class Inbox:
    """What has arrived of a swarm's members and waits to be shown."""

    members: tuple[str, ...]
    reports: "queue.SimpleQueue[RoundReport]" = field(default_factory=queue.SimpleQueue)
    flights: "queue.SimpleQueue[FlightSample]" = field(default_factory=queue.SimpleQueue)

    def arrived(self) -> tuple[list[RoundReport], list[FlightSample]]:
        """All of it, in order."""
        reports = [self.reports.get() for _ in range(self.reports.qsize())]
        samples = [self.flights.get() for _ in range(self.flights.qsize())]
        return (
            [report for report in reports if report.agent in self.members],
            [sample for sample in samples if sample.agent in self.members],
        )


def record_run(folder: RunFolder, config: SwarmFile, path: Path) -> None:
    """Write a recording of a run folder.

    Raises:
        ConfigError: the file cannot be written.
    """
    with opened(config, Output(save=path)) as recorder:
        recorder.take(history(folder, config), _flown(folder, config))


def _flown(folder: RunFolder, config: SwarmFile) -> list[FlightSample]:
    """The flight samples that a run has kept, in the order of time."""
    kept = (sample for agent in config.members for sample in read_flights(folder.flown(agent)))
    members = set(config.members)
    return sorted((s for s in kept if s.agent in members), key=lambda sample: sample.time)


def view(target: Target, output: Output, live: bool | None) -> None:
    """Show a swarm.

    Args:
        target: the swarm, and its run folder if there is one.
        output: where.
        live: the running swarm, or else the run folder; None means whichever is there, in this
            order; and where neither is, but somebody looks, a swarm that is still to come.

    Raises:
        NetworkError: nobody is there, and no run folder may be shown instead.
        ConfigError: there is no run folder, or a file cannot be written.
        SwarmError: the viewer does not start.
    """
    config, folder = target.config, target.folder
    if live is False and folder is None:
        raise ConfigError("--no-live shows a run folder: expected one as argument, not a file")
    waits = output.stays and (live or folder is None)
    if live is False or not _watch(config, output, waits):
        if live or folder is None:
            endpoints = ", ".join(config.endpoint(member) for member in config.members)
            raise NetworkError(
                f'nobody of swarm "{config.name}" is on {endpoints}: '
                "expected a running swarm, or a run folder as argument"
            )
        with opened(config, output) as recorder, stop_meanwhile() as stop:
            recorder.take(history(folder, config), _flown(folder, config))
            if output.web:
                stop.wait()
    if (save := output.save) is not None:
        size = save.stat().st_size / 1e6
        print(f"recording: {save} ({size:.1f} MB), to be seen with: rerun {save}")
    if output.screenshot is not None:
        print(f"screenshot: {output.screenshot}")


def _watch(config: SwarmFile, output: Output, waits: bool) -> bool:
    """Show a running swarm until the session is over; False if there is none and nobody waits."""
    keys, somebody, inbox = Keys(config.name), threading.Event(), Inbox(config.members)
    with observe(config) as session, Roster(session, keys, config.members) as roster:
        roster.call_on_change(somebody.set)
        watch_reports(session, keys, inbox.reports.put)
        watch_flights(session, keys, inbox.flights.put)
        with working(f"looking for swarm {config.name}"):
            found = bool(roster.present()) or somebody.wait(LOOK)
        if not found and not waits:
            return False
        with opened(config, output) as recorder, stop_meanwhile() as stop:
            end = "stop with Ctrl-C" if output.stays else "until it ends, or Ctrl-C"
            print(f"watching swarm {config.name}; {end}", flush=True)
            recorder.take(remembered(ask_history(session, keys, RECALL)))
            _follow(recorder, output, roster, inbox, stop)
    return True


def _follow(
    recorder: Recorder, output: Output, roster: Roster, inbox: Inbox, stop: threading.Event
) -> None:
    """Hand on what arrives until the session is over."""
    batch: list[Moment] = []
    samples: list[FlightSample] = []
    moment, begun = recorder.last, time.monotonic()
    seen, members = begun, set(inbox.members)
    while not stop.wait(TICK):
        now = time.monotonic()
        present = roster.present().keys() & members
        seen = now if present else seen
        reports, flown = inbox.arrived()
        moment = moment.then(reports, present, time.time())
        batch.append(moment)
        samples += flown
        if output.save is None or len(batch) == BATCH:
            recorder.take(batch, samples)
            batch, samples = [], []
        if output.seconds is not None and now - begun >= output.seconds:
            break
        if not output.stays and now - seen >= GONE:
            break
    recorder.take(batch, samples)
