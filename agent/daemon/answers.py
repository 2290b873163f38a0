"""What an agent answers to those who ask how it is: ``swarm status``, a health check, a scraper.

Interface: :class:`Life` (what its threads share), :func:`serve_status`, :func:`health`.
"""

import os
import time
from collections import deque
from dataclasses import dataclass, field

import msgspec
import psutil
import zenoh

from agent.daemon.rounds import Rounds
from agent.storage.checkpoint import Checkpoint
from swarm.mixing.consensus import sketch
from swarm.reports.history import History
from swarm.reports.telemetry import AgentStatus, NeighbourStatus, RoundReport
from swarm.wire.keys import Keys

UNWRITTEN = 3  # checkpoints kept in memory: neighbours stop within so many rounds of each other
SLOW = 4.0  # times what the newest round took, beside the wait for neighbours: longer is not well


@dataclass(slots=True)
class Life:
    """What the agent's threads share: written by the rounds, read by who answers questions.

    Attributes:
        state: ``waiting`` for the swarm, ``learning``, ``finished``.
        at: where it is.
        report: of the newest round.
        reported: monotonic time at its end [s]; wall clocks jump.
        history: what it remembers.
        unwritten: newest checkpoints that are in memory only.
    """

    state: str
    at: Checkpoint
    report: RoundReport | None = None
    reported: float = 0.0
    history: History = field(default_factory=History)
    unwritten: deque[Checkpoint] = field(default_factory=lambda: deque(maxlen=UNWRITTEN))


def status_of(life: Life, rounds: Rounds) -> AgentStatus:
    """How the agent is."""
    heard, report, machine = rounds.exchange.heard(), life.report, rounds.machine
    waiting = dict(machine.causes)
    links = rounds.exchange.links.report()
    nearby = {}
    for n in machine.nearby:
        round_, age = heard.get(n, (None, None))
        nearby[n] = NeighbourStatus(round=round_, age=age, link=links.get(n))
    return AgentStatus(
        agent=rounds.agent,
        incarnation=machine.life,
        pid=os.getpid(),
        state="waiting" if life.state == "learning" and "" in waiting else life.state,
        run=machine.membership.run,
        waiting=waiting,
        round=int(rounds.config.progress(life.at)),
        rounds=rounds.config.rounds,
        neighbours=nearby,
        value=report.value if report else None,
        distance=report.distance if report else None,
        disagreement=report.disagreement if report else None,
        sketch=tuple(sketch(life.at.theta).tolist()),
        rejected=rounds.exchange.guard.counts,
        quarantined=rounds.exchange.guard.quarantined(),
        one_sided=rounds.exchange.one_sided,
        memory_mb=_resident_mb(),
    )


def serve_status(session: zenoh.Session, keys: Keys, life: Life, rounds: Rounds) -> None:
    """Answer "how are you?" on Zenoh's thread."""
    key = keys.status(rounds.agent)

    def answer(query: zenoh.Query) -> None:
        query.reply(key, msgspec.msgpack.encode(status_of(life, rounds)))

    session.declare_queryable(key, answer)


def health(life: Life, rounds: Rounds) -> tuple[AgentStatus, RoundReport | None, bool]:
    """For :mod:`agent.daemon.metrics`: status, newest report, and whether all is well.

    An agent that waits is not ready yet; one that learns must get on.
    """
    report = life.report
    patience = rounds.config.timing.round + SLOW * (report.seconds if report else 0.0)
    stuck = report is not None and time.monotonic() - life.reported > patience
    status = status_of(life, rounds)
    well = status.state == "finished" or (status.state == "learning" and not stuck)
    return status, report, well


def _resident_mb() -> float:
    return float(psutil.Process().memory_info().rss) / 1e6
