"""Whence moments come and where recordings go: run folder or swarm; file or native viewer."""

import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import rerun as rr

from agent.config import SwarmFile
from agent.runfolder import RunFolder
from deploy.status import Target, observe
from deploy.viewer.drawing import Scene
from deploy.viewer.moments import Moment, history
from deploy.viewer.recorder import FLUSH, Recorder, StreamBrokenError
from swarm.errors import ConfigError, NetworkError, SwarmError
from swarm.keys import Keys
from swarm.roster import Roster
from swarm.telemetry import RoundReport, watch_reports

LOOK = 3.0  # [s] for somebody to be seen
TICK = 0.5  # [s] between moments
BATCH = 20  # moments that go to a file together: a column costs 1 kB, however short
GONE = 2.0  # [s] without anybody: the swarm has ended
MEMORY = "2GB"  # of the viewer; it drops the oldest data beyond
NO_DISPLAY = "the viewer needs a display, and there is none: expected --save FILE.rrd"


def record_run(folder: RunFolder, config: SwarmFile, path: Path) -> None:
    """Write a recording of a run folder.

    Raises:
        ConfigError: the file cannot be written.
    """
    with _recording(config, path) as recorder:
        recorder.take(history(folder, config))


def view(target: Target, save: Path | None, live: bool | None) -> None:
    """Show a swarm: in the native viewer, or (``save``) as a recording.

    Args:
        target: the swarm, and its run folder if there is one.
        save: file to write instead.
        live: the running swarm, or else the run folder; None means whichever is there, in this
            order.

    Raises:
        NetworkError: nobody is there, and no run folder may be shown instead.
        ConfigError: there is no run folder, or the file cannot be written.
        SwarmError: there is no display.
    """
    config, folder = target.config, target.folder
    if save is None and not _has_display():
        raise SwarmError(NO_DISPLAY)
    if live is False and folder is None:
        raise ConfigError("--no-live shows a run folder: expected one as argument, not a file")
    if live is False or not _watch(config, save):
        if live or folder is None:
            endpoints = ", ".join(config.endpoint(member) for member in config.members)
            raise NetworkError(
                f'nobody of swarm "{config.name}" is on {endpoints}: '
                "expected a running swarm, or a run folder as argument"
            )
        with _recording(config, save) as recorder:
            recorder.take(history(folder, config))
    if save is not None:
        print(
            f"recording: {save} ({save.stat().st_size / 1e6:.1f} MB), to be seen with: rerun {save}"
        )


def _watch(config: SwarmFile, save: Path | None) -> bool:
    """Show a running swarm until it ends or we are told to; False if there is none."""
    keys, somebody = Keys(config.name), threading.Event()
    inbox: queue.SimpleQueue[RoundReport] = queue.SimpleQueue()
    with observe(config) as session, Roster(session, keys) as roster:
        roster.call_on_change(somebody.set)
        watch_reports(session, keys, inbox.put)
        if not roster.present() and not somebody.wait(LOOK):
            return False
        with _recording(config, save) as recorder, _interruptible() as stop:
            print(f"watching swarm {config.name} until it ends; stop with Ctrl-C", flush=True)
            batch: list[Moment] = []
            for moment in _moments(config, roster, inbox, stop):
                batch.append(moment)
                if save is None or len(batch) == BATCH:
                    recorder.take(batch)
                    batch = []
            recorder.take(batch)
    return True


def _moments(
    config: SwarmFile,
    roster: Roster,
    inbox: "queue.SimpleQueue[RoundReport]",
    stop: threading.Event,
) -> Iterator[Moment]:
    """The swarm's moments, one a :data:`TICK`, until ``stop`` or nobody has been here for long."""
    moment, seen, members = Moment(), time.monotonic(), set(config.members)
    while time.monotonic() - seen < GONE and not stop.wait(TICK):
        present = roster.present().keys() & members
        if present:
            seen = time.monotonic()
        reports = [inbox.get() for _ in range(inbox.qsize())]
        arrived = [report for report in reports if report.agent in members]
        moment = moment.then(arrived, present, time.time())
        yield moment


@contextmanager
def _recording(config: SwarmFile, save: Path | None) -> Iterator[Recorder]:
    """A recorder that writes to a file, or to the native viewer if there is none.

    Raises:
        ConfigError: the file cannot be written.
        SwarmError: the viewer does not start.
    """
    scene, name = Scene.of(config), f"swarm {config.name}"
    if save is not None:
        try:
            save.open("wb").close()
        except OSError as error:
            raise ConfigError(f'"{save}" cannot be written: {error.strerror}') from None
    with rr.RecordingStream(name) as stream:
        if save is not None:
            stream.save(save, default_blueprint=scene.blueprint())
        else:
            _spawn(stream, scene)
        try:
            yield Recorder(stream, scene)
        except StreamBrokenError:
            stream.disconnect()
            if save is not None:
                raise
            print("the viewer was closed")


def _spawn(stream: rr.RecordingStream, scene: Scene) -> None:
    """Start the native viewer and connect to it.

    Raises:
        SwarmError: it does not start.
    """
    beside = Path(sys.executable).with_name("rerun")  # the venv need not be on the PATH
    try:
        rr.spawn(
            memory_limit=MEMORY,
            executable_path=str(beside) if beside.exists() else None,
            default_blueprint=scene.blueprint(),
            recording=stream,
        )
        stream.flush(timeout_sec=FLUSH)
    except RuntimeError as error:
        stream.disconnect()
        raise SwarmError(f"{NO_DISPLAY} ({error})") from None


def _has_display() -> bool:
    """Whether a window can be opened, as far as one can tell without trying."""
    return sys.platform != "linux" or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


@contextmanager
def _interruptible() -> Iterator[threading.Event]:
    """An event that Ctrl-C and SIGTERM set meanwhile."""
    stop = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        stop.set()

    previous = {n: signal.signal(n, on_signal) for n in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield stop
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
