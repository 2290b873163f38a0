"""Carries faults out as time passes.

Interface: :class:`Chaos`, driven by the launcher.
"""

import math
import os
import signal
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field

import msgspec

from agent.config.experiment import SwarmFile
from deploy.chaos.actions import Action, plan
from deploy.chaos.clocks import Clocks
from deploy.chaos.faults import Fault
from swarm.errors import SwarmError


@dataclass(slots=True)
class Chaos:
    """Faults to come and under way.

    Attributes:
        config: the swarm's.
        faults: those that have not begun.
        clocks: those that can jump.
        started: monotonic time of the file's zero [s]; None until every agent has reported.
        due: monotonic time [s], fault and action of what has begun, in order.
    """

    config: SwarmFile
    faults: list[Fault]
    clocks: Clocks
    started: float | None = None
    due: list[tuple[float, Fault, Action]] = field(default_factory=list)

    def advance(self, now: float, round_: int, pids: Mapping[str, int]) -> list[str]:
        """Do what is due; labels of what was done, for the user.

        Args:
            now: monotonic time [s].
            round_: of the slowest agent.
            pids: process of each running agent.

        Raises:
            SwarmError: a command failed.
        """
        if self.started is None:
            return []
        while (fault := self._next(now - self.started, round_)) is not None:
            self.faults.remove(fault)
            self._put_off(fault, round_)
            self.due += [(now + action.at, fault, action) for action in plan(fault, self.config)]
        self.due.sort(key=lambda entry: entry[0])
        labels = []
        while self.due and now >= self.due[0][0]:
            at, fault, action = self.due.pop(0)
            self._delay(fault, now - at)
            for agent, what in action.signals:
                _send(what, agent, pids)
            for command in action.commands:
                _run(command)
            for agent, by in action.jumps:
                self.clocks.jump(agent, by)
            if action.label:
                labels.append(action.label)
        return labels

    def wait(self, now: float) -> float:
        """Seconds until something is due."""
        return max(0.0, self.due[0][0] - now) if self.due else math.inf

    def _delay(self, late: Fault, by: float) -> None:
        """Keep the times between the actions of a fault, one of which comes late."""
        moved = [(at + by * (fault is late), fault, action) for at, fault, action in self.due]
        self.due = sorted(moved, key=lambda entry: entry[0])

    def _next(self, elapsed: float, round_: int) -> Fault | None:
        """A fault whose time has come."""
        ready = (f for f in self.faults if elapsed >= f.at and round_ >= f.round)
        return next(ready, None)

    def _put_off(self, begun: Fault, round_: int) -> None:
        """Keep faults apart that come to one agent after the other, however long each lasts."""
        for i, fault in enumerate(self.faults):
            if begun.apart and (fault.kind, fault.apart) == (begun.kind, begun.apart):
                due = round_ + (fault.round - begun.round)
                self.faults[i] = msgspec.structs.replace(fault, round=max(fault.round, due))

    def undo(self, pids: Mapping[str, int]) -> None:
        """End what lasts: let stopped agents go on, lift the network's faults."""
        for _, _, action in self.due:
            if not action.label.startswith("end of "):
                continue
            for agent, what in action.signals:
                if what == signal.SIGCONT:
                    _send(what, agent, pids)
            for command in action.commands:
                subprocess.run(command, capture_output=True, check=False, timeout=10)


def _send(what: signal.Signals, agent: str, pids: Mapping[str, int]) -> None:
    """Signal an agent's process, unless it has ended, which may be since ``pids`` was written."""
    if agent in pids:
        with suppress(ProcessLookupError):
            os.kill(pids[agent], what)


def _run(command: tuple[str, ...]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10)
    if done.returncode:
        raise SwarmError(f"fault: {' '.join(command)}: {done.stderr.strip()}")
