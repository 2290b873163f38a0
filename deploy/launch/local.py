"""The local launcher: every agent of a swarm file as a process on this machine.

It starts them, shows how they are getting on, brings back those that die, ends them all on Ctrl-C,
and prints the result.  It is an observer of the swarm like any other: the agents need nothing from
it but their first breath, and end when it is gone (their standard input closes).
"""

import os
import queue
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from types import FrameType

import msgspec

from agent.config.experiment import SwarmFile, load
from agent.learning.learners import build_learner
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder, open_run
from deploy.chaos.clocks import Clocks
from deploy.chaos.faults import Fault
from deploy.chaos.runner import Chaos
from deploy.launch.journal import Journal
from deploy.launch.outcome import conclude
from deploy.launch.progress import Progress
from deploy.observe.status import LATEST, RUNS, observe
from deploy.process.processes import end_all, last_line
from swarm.errors import ConfigError, NetworkError, SwarmError
from swarm.reports.telemetry import watch_reports
from swarm.wire.keys import Keys
from swarm.wire.security import OBSERVER

STOP_LIMIT = 2.0  # [s] from SIGTERM to SIGKILL
BACKOFF = (0.0, 0.5, 1.0, 2.0, 4.0)  # [s] before the first, second, ... restart of an agent
FORGIVEN = 60.0  # [s] an agent that lived so long starts its back-off anew
TICK = 0.1  # [s]


def prepare(config: SwarmFile, run: Path | None) -> tuple[RunFolder, SwarmFile, int]:
    """A new run folder and the configuration with ports that are free.

    Raises:
        ConfigError: the folder exists already, or a task cannot be built.
    """
    check_tasks(config)
    check_certificates(config)
    path = run or RUNS / f"{config.name}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    suffix = 1
    while run is None and path.exists():
        suffix += 1
        path = path.with_name(f"{path.name.split('.')[0]}.{suffix}")
    folder = RunFolder(path)
    if folder.config.exists():
        raise ConfigError(f'run folder "{path}" is in use: expected a new one, or --resume {path}')
    config = with_free_ports(config)
    folder.write_config(config)
    if run is None:
        _point_latest_to(path)
    return folder, config, 0


def check_tasks(config: SwarmFile) -> None:
    """Build every task once, so that a mistake is told before anything starts.

    Raises:
        ConfigError: a task cannot be built, or two tasks do not fit one policy.
    """
    parts = {}
    for agent in config.members:
        learner = build_learner(config, agent)
        parts[agent] = learner.parts
        learner.close()
    first = config.members[0]
    for agent, shape in parts.items():
        if shape != parts[first]:
            raise ConfigError(
                f'task of "{agent}" needs parameters {dict(shape)}: expected those of "{first}", '
                f"{dict(parts[first])}, for one common policy"
            )


def check_certificates(config: SwarmFile) -> None:
    """See that every agent and the launcher itself have their files of ``[network.security]``.

    Raises:
        ConfigError: one of them will not do.
    """
    for name in (*config.members, OBSERVER):
        config.network.security.check(name)


def resume_run(path: Path, settings: Iterable[str]) -> tuple[RunFolder, SwarmFile, int | None]:
    """A run folder to go on with, its configuration, and the last round that all agents have.

    Where rounds are not common (``pace = "async"``) there is none to begin with: every agent goes
    on from its own.

    Raises:
        ConfigError: not a run folder.
        CheckpointError: no common round.
    """
    folder = open_run(path)
    config = with_free_ports(load(folder.config, settings))
    check_certificates(config)
    begin = None if config.pace == "async" else folder.common_round(config.members)
    folder.write_config(config)
    return folder, config, begin


def with_free_ports(config: SwarmFile) -> SwarmFile:
    """The configuration, moved to other ports where its own are taken."""
    if all(agent.endpoint for agent in config.agents):
        return config
    wanted = range(config.network.base_port, config.network.base_port + len(config.agents))
    if all(_is_free(config.network.host, port) for port in wanted):
        return config
    first = random.randrange(20_000, 50_000)  # two launchers at once look in different places
    for base in range(first, 60_000, len(config.agents)):
        ports = range(base, base + len(config.agents))
        if all(_is_free(config.network.host, port) for port in ports):
            network = msgspec.structs.replace(config.network, base_port=base)
            return msgspec.structs.replace(config, network=network)
    raise ConfigError(f"no {len(config.agents)} free ports in a row on {config.network.host}")


def _is_free(host: str, port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return False
    return True


def _point_latest_to(path: Path) -> None:
    draft = LATEST.with_name(f".latest-{os.getpid()}")
    draft.symlink_to(path.name)
    draft.replace(LATEST)


@dataclass(slots=True)
class Worker:
    """One agent's process and its history.

    Attributes:
        agent: id.
        process: the running one, or the last one.
        started: when [monotonic s].
        failures: in a row.
        restart_at: when to start again [monotonic s], or None.
        done: it has finished its rounds, or is given up.
    """

    agent: str
    process: subprocess.Popen[bytes]
    started: float
    failures: int = 0
    restart_at: float | None = None
    done: bool = False


@dataclass(slots=True)
class Fleet:
    """The agents' processes; a context manager that leaves none behind."""

    folder: RunFolder
    config: SwarmFile
    journal: Journal
    clocks: Clocks
    workers: dict[str, Worker] = field(default_factory=dict)
    exits: "queue.SimpleQueue[tuple[str, int]]" = field(default_factory=queue.SimpleQueue)

    def start(self, agent: str, begin: int | None) -> Worker:
        """Start an agent afresh (``begin`` 0), from a round, or (None) where it stopped."""
        command = [sys.executable, "-m", "deploy.cli", "agent", str(self.folder.config)]
        command += ["--id", agent, "--run", str(self.folder.path), "--supervised"]
        if begin != 0:
            command.append("--resume")
        if begin:
            command += ["--begin", str(begin)]
        if namespace := self.config.agents[self.config.index(agent)].namespace:
            command = ["ip", "netns", "exec", namespace, *command]
        self.folder.prepare(agent)
        with self.folder.log(agent).open("ab") as log:
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=log, stderr=log, start_new_session=True,
                env=os.environ | self.clocks.environment(agent),
            )  # fmt: skip
        waiting = threading.Thread(target=self._wait, args=(agent, process), daemon=True)
        waiting.start()
        worker = self.workers.get(agent)
        if worker is None:
            worker = self.workers[agent] = Worker(agent, process, time.monotonic())
        worker.process, worker.started, worker.restart_at = process, time.monotonic(), None
        return worker

    def _wait(self, agent: str, process: subprocess.Popen[bytes]) -> None:
        self.exits.put((agent, process.wait()))

    def attend(self, timeout: float) -> None:
        """Deal with agents that have ended and with those whose time to come back is there.

        Raises:
            SwarmError: an agent refused its configuration; its own line says why.
        """
        try:
            agent, code = self.exits.get(timeout=timeout)
        except queue.Empty:
            pass
        else:
            self._on_exit(self.workers[agent], code)
        now = time.monotonic()
        for worker in self.workers.values():
            if worker.restart_at is not None and now >= worker.restart_at:
                text = f"{worker.agent} starts again from its newest checkpoint"
                self.journal.say("restarted", text, worker.agent)
                self.start(worker.agent, None)

    def _on_exit(self, worker: Worker, code: int) -> None:
        held = checkpoint.rounds_in(self.folder.checkpoints(worker.agent))
        if code == 0 and held and self._finished(worker.agent):
            worker.done = True
            return
        what = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"
        if code == 0:
            what = f"was stopped at round {held[-1] if held else 0}"
        never_played = not self.folder.metrics(worker.agent).exists()
        if code in {ConfigError.exit_code, 4} or (code == NetworkError.exit_code and never_played):
            raise SwarmError(f"{worker.agent} {what}: {last_line(self.folder.log(worker.agent))}")
        now = time.monotonic()
        worker.failures = 1 if now - worker.started > FORGIVEN else worker.failures + 1
        if worker.failures > len(BACKOFF):
            worker.done = True
            self.journal.say(
                "given-up",
                f"{worker.agent} {what}, {worker.failures} times in a row: given up; "
                f"see {self.folder.log(worker.agent)}",
                worker.agent,
            )
            return
        delay = BACKOFF[worker.failures - 1]
        worker.restart_at = now + delay
        text = f"{worker.agent} {what}, starts again in {delay:.1f} s"
        self.journal.say("ended", text, worker.agent)

    def _finished(self, agent: str) -> bool:
        return self.config.progress(self.folder.newest(agent)) >= self.config.rounds

    @property
    def pids(self) -> dict[str, int]:
        """Processes that run."""
        return {w.agent: w.process.pid for w in self.workers.values() if w.process.poll() is None}

    @property
    def done(self) -> bool:
        """Whether every agent has finished or is given up."""
        return all(worker.done for worker in self.workers.values())

    def close(self) -> None:
        """End every process: SIGTERM, then SIGKILL after :data:`STOP_LIMIT`."""
        end_all([worker.process for worker in self.workers.values()], STOP_LIMIT)
        for worker in self.workers.values():
            if worker.process.stdin is not None:
                worker.process.stdin.close()


def launch(
    folder: RunFolder,
    config: SwarmFile,
    begin: int | None,
    record: bool,
    faults: Sequence[Fault] = (),
) -> int:
    """Run a swarm to its end and report.

    Args:
        folder: the run folder.
        config: the resolved configuration.
        begin: first round; 0 starts afresh, None where each agent stopped.
        record: write a Rerun recording at the end.
        faults: to be injected on the way.

    Returns:
        Exit code: 0 all agents finished; 1 some were given up; 130 interrupted.
    """
    interrupted = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        interrupted.set()

    previous = {n: signal.signal(n, on_signal) for n in (signal.SIGTERM, signal.SIGINT)}
    try:
        with ExitStack() as resources:
            progress = resources.enter_context(Progress(config))
            journal = Journal(folder.events, progress)
            jumping = (agent for fault in faults if fault.kind == "clock" for agent in fault.agents)
            clocks = Clocks(folder.path / "clocks", frozenset(jumping))
            fleet = Fleet(folder, config, journal, clocks)
            resources.callback(fleet.close)
            for agent in config.members:
                fleet.start(agent, begin)
            session = resources.enter_context(observe(config))
            watch_reports(session, Keys(config.name), progress.take)
            chaos = Chaos(config, list(faults), clocks)
            resources.callback(lambda: chaos.undo(fleet.pids))
            while not fleet.done and not interrupted.is_set():
                fleet.attend(min(TICK, chaos.wait(time.monotonic())))
                if chaos.started is None and progress.complete:
                    chaos.started = time.monotonic()
                for label in chaos.advance(time.monotonic(), progress.round, fleet.pids):
                    journal.say("fault", f"fault: {label}")
                progress.show()
        if interrupted.is_set():
            print(f"stopped; go on with: swarm up --resume {folder.path}")
            return 130
        conclude(folder, config, record)
        return 0 if all(worker.failures <= len(BACKOFF) for worker in fleet.workers.values()) else 1
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
