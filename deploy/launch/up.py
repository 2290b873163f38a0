"""``swarm up``: every agent of a swarm file as a process on this machine.

It starts them, shows how they are getting on, brings back those that die, ends them all on Ctrl-C,
and prints the result.  It is an observer of the swarm like any other: the agents need nothing from
it but their first breath, and end when it is gone (their standard input closes).
"""

import signal
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from types import FrameType

from deploy.chaos.clocks import Clocks
from deploy.chaos.faults import Fault
from deploy.chaos.runner import Chaos
from deploy.launch.fleet import BACKOFF, Fleet
from deploy.launch.journal import Journal
from deploy.launch.outcome import conclude, interrupt, outcome_kept
from deploy.launch.preparation import Prepared
from deploy.launch.progress import Progress
from deploy.observe.status import observe
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
    """
    folder, config = prepared.folder, prepared.config
    interrupted = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        interrupted.set()

    previous = {n: signal.signal(n, on_signal) for n in (signal.SIGTERM, signal.SIGINT)}
    try:
        with outcome_kept(folder, config), ExitStack() as resources:
            progress = resources.enter_context(Progress(config))
            journal = Journal(folder.events, progress)
            jumping = (agent for fault in faults if fault.kind == "clock" for agent in fault.agents)
            clocks = Clocks(folder.path / "clocks", frozenset(jumping))
            fleet = Fleet(folder, config, journal, clocks)
            resources.callback(fleet.close)
            for agent in config.members:
                fleet.start(agent, prepared.begin)
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
            for fault in chaos.faults if fleet.done else ():
                progress.say(f"fault: {fault} never came: the run was over first")
        if interrupted.is_set():
            interrupt(folder, config)
            print(f"stopped; go on with: swarm up --resume {folder.path}")
            return 130
        given_up = [w.agent for w in fleet.workers.values() if w.failures > len(BACKOFF)]
        conclude(folder, config, record, given_up)
        return 1 if given_up else 0
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
