"""Sessions of the viewer: where they lead, what they begin with, when they end."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest
import rerun as rr
from rerun.experimental import ViewerClient
from zenoh import Query

from agent.config.experiment import SwarmFile, load
from agent.storage.runfolder import RunFolder
from deploy.launch.preparation import held_ports
from deploy.observe.status import Target
from deploy.viewer import Output, outputs, session, view
from deploy.viewer.drawing import Scene
from swarm.errors import ConfigError, NetworkError, SwarmError
from swarm.reports.history import History
from swarm.reports.telemetry import TelemetryPublisher
from swarm.wire.keys import Keys
from swarm.wire.roster import Roster
from swarm.wire.session import open_session
from tests.deploy.viewer.test_viewer import RING, columns, folder_of, report, ring, scalars


def test_without_a_display_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(SwarmError, match=r"needs a display.*--save FILE\.rrd"):
        Output()


def test_a_viewer_that_does_not_start_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**options: object) -> None:
        raise RuntimeError("no window")

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(ViewerClient, "spawn", fail)
    monkeypatch.setattr(session, "_watch", lambda config, output, waits: False)
    with pytest.raises(SwarmError, match=r"FILE\.png \(no window\)"):
        view(Target(RING, RunFolder(Path("none"))), Output(), None)


def test_closing_the_viewer_ends_the_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(timeout_sec: float) -> None:
        raise RuntimeError("severed")

    def connect(
        stream: rr.RecordingStream, scene: Scene, output: Output, guards: ExitStack
    ) -> None:
        stream.save(tmp_path / "instead.rrd")
        monkeypatch.setattr(stream, "flush", broken)
        monkeypatch.setattr(stream, "disconnect", lambda: monkeypatch.delattr(stream, "flush"))

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(outputs, "_connect", connect)
    view(Target(RING, folder_of([ring(0)], tmp_path / "run")), Output(), False)
    assert capsys.readouterr().out == "the viewer was closed\n"


def test_with_nobody_there_it_shows_the_folder_if_it_may(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(session, "_watch", lambda config, output, waits: False)
    folder, path = folder_of([ring(0)], tmp_path / "run"), tmp_path / "seen.rrd"
    view(Target(RING, folder), Output(save=path), None)
    assert scalars(path, "/return/drone3") == ([0], [3.0])
    assert f"recording: {path} (0." in capsys.readouterr().out
    with pytest.raises(NetworkError, match="nobody of swarm"):
        view(Target(RING, folder), Output(save=path), True)
    with pytest.raises(NetworkError, match="nobody of swarm"):
        view(Target(RING, None), Output(save=path), None)


def test_a_users_mistakes_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--no-live"):
        view(Target(RING, None), Output(save=tmp_path / "seen.rrd"), False)
    folder = folder_of([ring(0)], tmp_path / "run")
    with pytest.raises(ConfigError, match="cannot be written: No such file"):
        view(Target(RING, folder), Output(save=tmp_path / "nowhere" / "seen.rrd"), False)


@pytest.fixture
def config() -> Iterator[SwarmFile]:
    """A swarm whose ports nobody else takes."""
    base = load(Path("deploy/library/swarms/gridworld-a.toml"))
    with held_ports(msgspec.structs.replace(base, rounds=100, name="watched")) as placed:
        yield placed


@pytest.mark.integration
def test_it_watches_a_running_swarm_to_its_end(config: SwarmFile, tmp_path: Path) -> None:
    keys = Keys(config.name)

    def agent() -> None:
        """Announces drone0, waits for a watcher, reports the last round and is gone."""
        watched = threading.Event()
        with (
            open_session(
                config.network, config.party("drone0"), [config.endpoint("drone0")], ()
            ) as zenoh,
            Roster(zenoh, keys, config.members) as roster,
            TelemetryPublisher(zenoh, keys, "drone0") as telemetry,
        ):
            telemetry._reports.declare_matching_listener(lambda status: watched.set())
            roster.announce("drone0", "1")
            assert watched.wait(20)
            telemetry.put(report(0, 99, sketch=(1.0,)), always=True)

    path, thread = tmp_path / "live.rrd", threading.Thread(target=agent)
    thread.start()
    view(Target(config, None), Output(save=path), None)
    thread.join()
    assert scalars(path, "/return/drone0") == ([99], [0.99])
    _, texts = columns(path, "/events", "TextLog:text")
    assert texts == [["drone0 joined"], ["drone0 finished"]]


@pytest.mark.integration
def test_it_begins_with_what_was_before_and_outlives_the_swarm(
    config: SwarmFile, tmp_path: Path
) -> None:
    keys = Keys(config.name)

    def live(rounds: range, incarnation: str) -> None:
        """drone0 remembers these rounds but for the last, which it reports; then it is gone."""
        watched, asked = threading.Event(), threading.Event()
        memory = History()
        for round_ in rounds[:-1]:
            memory.take(report(0, round_, sketch=(1.0,)))
        listen = [config.endpoint("drone0")]
        with (
            open_session(config.network, config.party("drone0"), listen, ()) as zenoh,
            Roster(zenoh, keys, config.members) as roster,
            TelemetryPublisher(zenoh, keys, "drone0") as telemetry,
        ):
            key = keys.history("drone0")

            def answer(query: Query) -> None:
                query.reply(key, msgspec.msgpack.encode(memory.reports()))
                asked.set()

            zenoh.declare_queryable(key, answer)
            telemetry._reports.declare_matching_listener(lambda status: watched.set())
            roster.announce("drone0", incarnation)
            assert watched.wait(20)
            assert incarnation != "1" or asked.wait(20)
            telemetry.put(report(0, rounds[-1], sketch=(1.0,)), always=True)

    def swarm() -> None:
        try:
            live(range(4), "1")
            live(range(4, 8), "2")
        finally:
            until_seen = threading.Event()
            until_seen.wait(2 * session.TICK)  # the last report reaches the next moment
            os.kill(os.getpid(), signal.SIGTERM)

    path, thread = tmp_path / "live.rrd", threading.Thread(target=swarm)
    thread.start()
    view(Target(config, None), Output(save=path, seconds=60.0), True)
    thread.join()
    rounds, values = scalars(path, "/return/drone0")
    # Round 3 is missing where both lives' reports came within one moment.
    assert rounds in ([0, 1, 2, 3, 7], [0, 1, 2, 7])
    assert values == [k / 100 for k in rounds]
    _, texts = columns(path, "/events", "TextLog:text")
    assert texts[0] == ["drone0 joined"]
