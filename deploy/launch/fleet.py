"""The agents' processes: started, brought back when they die, ended with the block."""

import os
import queue
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field

from agent.config.experiment import SwarmFile
from agent.errors import CheckpointError, DivergenceError
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder
from deploy.chaos.clocks import Clocks
from deploy.launch.journal import Journal
from deploy.process.processes import end_all, last_line
from swarm.errors import ConfigError, NetworkError, SwarmError

STOP_LIMIT = 1.5  # [s] from SIGTERM to SIGKILL
BACKOFF = (0.0, 0.5, 1.0, 2.0, 4.0)  # [s] before the first, second, ... restart of an agent
LEFT_BEHIND = 5.0  # [s] that the last agent has to finish by itself
FORGIVEN = 60.0  # [s] an agent that lived so long starts its back-off anew


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
        alone: it was started when all others were done, and so needs none of them.
    """

    agent: str
    process: subprocess.Popen[bytes]
    started: float
    failures: int = 0
    restart_at: float | None = None
    done: bool = False
    alone: bool = False


@dataclass(slots=True)
class Fleet:
    """The agents' processes.  Close it, and none is left.

    Attributes:
        folder, config: the run.
        journal: told what happens.
        clocks: what the agents' clocks show.
        workers: by agent.
        exits: agents that have ended, and their exit codes.
        dismissed: when they were told to end [monotonic s].
    """

    folder: RunFolder
    config: SwarmFile
    journal: Journal
    clocks: Clocks
    workers: dict[str, Worker] = field(default_factory=dict)
    last_since: float | None = None  # since when only one agent is left [monotonic s]
    exits: "queue.SimpleQueue[tuple[str, int]]" = field(default_factory=queue.SimpleQueue)
    dismissed: float | None = None

    def start(self, agent: str, begin: int | None = None, *, fresh: bool = False) -> Worker:
        """Start an agent from a round, or (None) where it stopped; ``fresh`` where it has not run.

        Raises:
            ConfigError: its folders cannot be made.
        """
        command = [sys.executable, "-m", "deploy.cli", "agent", str(self.folder.config)]
        command += ["--id", agent, "--run", str(self.folder.path), "--supervised"]
        if not fresh:
            command.append("--resume")
        if begin is not None:
            command += ["--begin", str(begin)]
        if alone := self._is_last(agent):
            command += ["--set", "quorum.minimum=0"]
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
        worker.alone = alone
        return worker

    def _wait(self, agent: str, process: subprocess.Popen[bytes]) -> None:
        self.exits.put((agent, process.wait()))

    def attend(self, timeout: float) -> None:
        """Deal with agents that have ended and with those whose time to come back is there.

        Raises:
            DivergenceError: an agent's learning has diverged.
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
                self.start(worker.agent)
            elif not worker.done and not worker.alone and self._is_left_behind(worker.agent, now):
                text = f"{worker.agent} waits for others that have finished: it ends without them"
                self.journal.say("restarted", text, worker.agent)
                worker.alone = True
                worker.process.terminate()

    def _is_last(self, agent: str) -> bool:
        """Whether all others are done: nobody will come to make up a quorum."""
        others = [worker for name, worker in self.workers.items() if name != agent]
        return len(others) == len(self.config.members) - 1 and all(w.done for w in others)

    def _is_left_behind(self, agent: str, now: float) -> bool:
        """Whether the others have been done for longer than they wait for it."""
        if not self._is_last(agent):
            self.last_since = None
            return False
        self.last_since = now if self.last_since is None else self.last_since
        return now - self.last_since > self.config.timing.finish + LEFT_BEHIND

    def _on_exit(self, worker: Worker, code: int) -> None:
        held = checkpoint.rounds_in(self.folder.checkpoints(worker.agent))
        if code == 0 and held and self._finished(worker.agent):
            worker.done = True
            return
        what = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"
        if code == 0:
            what = f"was stopped at round {held[-1] if held else 0}"
        never_played = not self.folder.metrics(worker.agent).exists()
        if code == DivergenceError.exit_code:
            raise DivergenceError(last_line(self.folder.log(worker.agent)))
        refused = {ConfigError.exit_code, CheckpointError.exit_code}
        if code in refused or (code == NetworkError.exit_code and never_played):
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

    def dismiss(self) -> None:
        """Tell every process to end, by SIGTERM."""
        for worker in self.workers.values():
            if worker.process.poll() is None:
                worker.process.terminate()
        self.dismissed = time.monotonic()

    def close(self) -> None:
        """End every process: SIGTERM, then SIGKILL :data:`STOP_LIMIT` after it was dismissed."""
        waited = time.monotonic() - self.dismissed if self.dismissed is not None else 0.0
        end_all([worker.process for worker in self.workers.values()], STOP_LIMIT - waited)
        for worker in self.workers.values():
            if worker.process.stdin is not None:
                worker.process.stdin.close()
