"""``swarm up``: every agent of a swarm file as a process on this machine.

It starts them, shows how they are getting on, brings back those that die, ends them all on Ctrl-C,
and prints the result.  It is an observer of the swarm like any other: the agents need nothing from
it but their first breath, and end when it is gone (their standard input closes).
"""

import shlex
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from agent.config.experiment import SwarmFile
from agent.storage.appender import Appender
from agent.storage.runfolder import RunFolder
from deploy.chaos.clocks import Clocks
from deploy.chaos.faults import Fault
from deploy.chaos.runner import Chaos
from deploy.launch.fleet import BACKOFF, Fleet
from deploy.launch.journal import Journal
from deploy.launch.outcome import conclude, interrupt, outcome_kept
from deploy.launch.preparation import Prepared, is_finished, open_again, where_to_begin
from deploy.launch.progress import Progress
from deploy.observe.status import observe
from deploy.process.signals import StoppedError, stopping_at_signals
from swarm.reports.telemetry import watch_reports
from swarm.wire.keys import Keys

TICK = 0.1  # [s]


def launch(prepared: Prepared, record: bool, faults: Sequence[Fault] = ()) -> int:
    """Run a swarm to its end and report.

    Args:
        prepared: the swarm.
        record: write a Rerun recording at the end.
        faults: to be injected on the way.

    Returns:
        Exit code: 0 all agents finished; 1 some were given up; 130 interrupted.

    Raises:
        DivergenceError: learning has diverged.
        SwarmError: an agent refused its configuration.
    """
    folder, config, stop = prepared.folder, prepared.config, prepared.stop
    with outcome_kept(folder, config), ExitStack() as resources:
        progress = resources.enter_context(Progress(config))
        kept = resources.enter_context(Appender(folder.events, lines=True, warn=progress.say))
        journal = Journal(kept, progress)
        jumping = (agent for fault in faults if fault.kind == "clock" for agent in fault.agents)
        clocks = Clocks(folder.path / "clocks", frozenset(jumping))
        fleet = Fleet(folder, config, journal, clocks)
        resources.callback(fleet.close)
        for agent in config.members:
            if not stop.is_set():
                fleet.start(agent, prepared.begin, fresh=prepared.fresh)
        session = resources.enter_context(observe(config))
        watch_reports(session, Keys(config.name), progress.take)
        chaos = Chaos(config, list(faults), clocks)
        resources.callback(lambda: chaos.undo(fleet.pids))
        while not fleet.done and not stop.is_set():
            fleet.attend(min(TICK, chaos.wait(time.monotonic())))
            if chaos.started is None and progress.complete:
                chaos.started = time.monotonic()
            for label in chaos.advance(time.monotonic(), progress.round, fleet.pids):
                journal.say("fault", f"fault: {label}")
            progress.show()
        for fault in chaos.faults if fleet.done else ():
            progress.say(f"fault: {fault} never came: the run was over first")
        if stop.is_set():
            fleet.dismiss()
    if stop.is_set():
        interrupt(folder, config)
        print(advice(folder, config))
        return 130
    given_up = [w.agent for w in fleet.workers.values() if w.failures > len(BACKOFF)]
    try:
        with stopping_at_signals():
            conclude(folder, config, record, given_up)
    except StoppedError:
        print(f"stopped, but all rounds are played; for the result: {_again(folder)}")
        return 130
    return 1 if given_up else 0


def show_finished(path: Path, settings: Sequence[str]) -> bool:
    """Print the result of a run that has played all rounds; False where it has not.

    Raises:
        ConfigError: not a run folder.
    """
    folder, config = open_again(path, settings)
    if not is_finished(folder, config):
        return False
    print(f"run {folder.path} is finished: all {config.rounds} rounds are played")
    conclude(folder, config, record=False)
    return True


def advice(folder: RunFolder, config: SwarmFile) -> str:
    """What a user can do with a run that was stopped."""
    begin = where_to_begin(folder, config)
    if begin == 0:
        return f"stopped before the first checkpoint; begin again with: {_again(folder)}"
    where = "" if begin is None else f" before round {begin}"
    return f"stopped{where}; go on with: {_again(folder)}"


def _again(folder: RunFolder) -> str:
    return f"swarm up --resume {shlex.quote(str(folder.path))}"
