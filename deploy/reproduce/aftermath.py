"""What a fault cost a swarm, from what its agents wrote down.  Pure: nothing is run or read here.

Interface: :func:`examine` turns a :class:`Trace` into an :class:`Aftermath`.

The swarm is *whole* in a round that every agent played with all its neighbours, and *linked* in one
in which what was mixed leads from every agent to every other.  It has *agreed* when nobody is
farther from a neighbour than :data:`TOLERATED` times what is usual in a run without faults.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

import networkx as nx
import numpy as np

from deploy.chaos.faults import Fault
from deploy.launch.journal import Event
from swarm.reports.telemetry import RoundReport

SLOW = 0.5  # [s] a round that takes longer has been held up
TOLERATED = 1.2  # times the usual disagreement
USUAL = 0.95  # share of the rounds of a run without faults in which disagreement is usual
Reports = Mapping[str, Sequence[RoundReport]]


@dataclass(frozen=True)
class Trace:
    """What a run left behind.

    Attributes:
        neighbours: of every agent while all are there.
        reports: of every agent, in the order of its file.
        faults: injected.
        events: of the launcher's journal.
    """

    neighbours: Mapping[str, frozenset[str]]
    reports: Reports
    faults: tuple[Fault, ...] = ()
    events: tuple[Event, ...] = ()


@dataclass(frozen=True)
class Aftermath:
    """What became of a run.

    Attributes:
        usual: median round [s].
        longest: the longest round once the faults had begun [s].
        following: the longest but one of any single agent [s].
        slow: most rounds over :data:`SLOW` of any single agent.
        during: mean round while the faults lasted [s].
        absence: rounds from the end of the faults (kill, restart: their beginning) until the swarm
            is whole and has agreed; None if it never is.
        reunion: from the first round in which both sides hear each other until the swarm is linked
            and has agreed; None where it never is, or nothing was cut.
        reconnect: from the end of the faults until that first round [s]; likewise.
        restarts: of agents by the launcher.
        repeated: rounds that an agent played twice.
        one_sided: edges that one end mixed and the other, in the same round, did not.
    """

    usual: float
    longest: float
    following: float
    slow: int
    during: float
    absence: int | None
    reunion: int | None
    reconnect: float | None
    restarts: int
    repeated: int
    one_sided: int


def examine(trace: Trace, first: int, tolerated: float) -> Aftermath:
    """See :class:`Aftermath`.

    Args:
        trace: of the run.
        first: round from which it counts, where no fault says when.
        tolerated: largest distance between neighbours in a swarm that agrees.
    """
    began, resumed, ended = _span(trace, first)
    spared = _spared(trace)
    after = {
        agent: [*sorted((r.seconds for r in reports if r.round >= began), reverse=True), 0.0, 0.0]
        for agent, reports in spared.items()
    }
    meanwhile = [
        r.seconds for reports in spared.values() for r in reports if began <= r.round <= resumed
    ]
    well = agreement(disagreement(trace), _broken(trace, resumed), tolerated)
    met = _meeting(trace, resumed)
    agreed = None if met is None else agreement(disagreement(trace, linked), met.round, tolerated)
    return Aftermath(
        usual=median(r.seconds for reports in trace.reports.values() for r in reports),
        longest=max(seconds[0] for seconds in after.values()),
        following=max(seconds[1] for seconds in after.values()),
        slow=max(sum(s > SLOW for s in seconds) for seconds in after.values()),
        during=mean(meanwhile),
        absence=None if well is None else well - resumed,
        reunion=None if agreed is None or met is None else agreed - met.round,
        reconnect=None if met is None else max(0.0, met.time - ended),
        restarts=sum(event.kind == "restarted" for event in trace.events),
        repeated=repeated(trace.reports),
        one_sided=one_sided(trace.reports),
    )


def whole(trace: Trace, reports: Sequence[RoundReport]) -> bool:
    """Whether in this round everybody mixed with all its neighbours."""
    return all(report.weights.keys() == trace.neighbours[report.agent] for report in reports)


def linked(_: Trace, reports: Sequence[RoundReport]) -> bool:
    """Whether what was mixed in this round leads from every agent to every other."""
    edges = [(report.agent, other) for report in reports for other in report.weights]
    return bool(nx.is_connected(nx.Graph([*edges, *((r.agent, r.agent) for r in reports)])))


def disagreement(
    trace: Trace, counts: Callable[[Trace, Sequence[RoundReport]], bool] = whole
) -> dict[int, float]:
    """Largest distance between agents that mixed, in every round that all played and ``counts``."""
    by_round: dict[int, list[RoundReport]] = {}
    for reports in trace.reports.values():
        for report in reports:
            by_round.setdefault(report.round, []).append(report)
    return {
        round_: max(report.disagreement for report in reports)
        for round_, reports in sorted(by_round.items())
        if len(reports) == len(trace.neighbours) and counts(trace, reports)
    }


def usual_disagreement(undisturbed: Trace, first: int) -> float:
    """What disagreement is usual from a round on."""
    found = [apart for round_, apart in disagreement(undisturbed).items() if round_ >= first]
    return float(np.quantile(found, USUAL))


def agreement(apart: Mapping[int, float], since: int, tolerated: float) -> int | None:
    """First round from ``since`` on in which the swarm has agreed, given its disagreement."""
    return next((r for r, distance in apart.items() if r >= since and distance <= tolerated), None)


def repeated(reports: Reports) -> int:
    """Rounds that stand in an agent's file again, or after a later one."""
    return sum(
        later.round <= earlier.round
        for played in reports.values()
        for earlier, later in itertools.pairwise(played)
    )


def one_sided(reports: Reports) -> int:
    """Edges on which two agents that both played a round do not say the same of it."""
    weights = {
        (agent, report.round): report.weights
        for agent, played in reports.items()
        for report in played
    }
    return sum(
        abs(weight - weights[other, round_].get(agent, 0.0)) > 1e-9
        for (agent, round_), used in weights.items()
        for other, weight in used.items()
        if (other, round_) in weights
    )


def _span(trace: Trace, first: int) -> tuple[int, int, float]:
    """Rounds in which the faults began and ended, and when they did [Unix s]; ``first`` without."""
    times = [event.time for event in trace.events if event.kind == "fault"]
    if not times:
        return first, first, 0.0
    wrong = {agent for f in trace.faults if f.kind == "clock" for agent in f.agents}
    witnesses = [reports for agent, reports in trace.reports.items() if agent not in wrong]
    began = min(_played(reports, times[0]) for reports in witnesses)
    return began, max(_played(reports, times[-1]) for reports in witnesses), times[-1]


def _played(reports: Sequence[RoundReport], moment: float) -> int:
    """How far an agent had come at a moment [Unix s]."""
    return max((report.round for report in reports if report.time <= moment), default=0)


def _spared(trace: Trace) -> Reports:
    """Reports of those who were not stopped themselves."""
    stopped = {agent for f in trace.faults if f.kind in {"freeze", "slow"} for agent in f.agents}
    return {a: reports for a, reports in trace.reports.items() if a not in stopped}


def _broken(trace: Trace, since: int) -> int:
    """First round without those who were ended, whose absence begins with the fault."""
    if not any(fault.kind in {"kill", "restart"} for fault in trace.faults):
        return since
    complete = disagreement(trace)
    last = max(r.round for played in trace.reports.values() for r in played)
    return next((round_ for round_ in range(since, last) if round_ not in complete), since)


def _meeting(trace: Trace, since: int) -> RoundReport | None:
    """The first round, from ``since`` on, in which somebody mixed across a partition."""
    cut = next((fault for fault in trace.faults if fault.kind == "partition"), None)
    if cut is None:
        return None
    across = (
        report
        for agent, reports in trace.reports.items()
        for report in reports
        if report.round >= since
        and any((agent in cut.agents) != (other in cut.agents) for other in report.weights)
    )
    return min(across, key=lambda report: report.round, default=None)
