"""A swarm at one moment, wherever it is watched from, and what changed since the one before.

Live, a moment is what was heard last of every agent that is here; in a run folder it is a round.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, Self

import numpy as np

from agent.config.experiment import SwarmFile
from agent.storage.runfolder import RunFolder
from swarm.mixing.consensus import sketch_errors
from swarm.mixing.weights import graph
from swarm.reports.telemetry import RoundReport

MOMENTS = 2000  # most moments of a run folder that are shown

Edge = tuple[str, str]  # two agents, sorted


@dataclass(frozen=True, slots=True)
class Moment:
    """Who is here and what they said last.

    Attributes:
        round: newest round that anybody reported; -1 before the first.
        time: when [Unix s].
        present: agents that are here.
        reports: newest report of each of them that has made one.
    """

    round: int = -1
    time: float = 0.0
    present: frozenset[str] = frozenset()
    reports: Mapping[str, RoundReport] = field(default_factory=dict)

    @classmethod
    def of(cls, reports: Iterable[RoundReport]) -> Self:
        """The moment at which these agents, and nobody else, made their reports."""
        by_agent = {report.agent: report for report in reports}
        return cls(
            max(report.round for report in by_agent.values()),
            max(report.time for report in by_agent.values()),
            frozenset(by_agent),
            by_agent,
        )

    def then(self, arrived: Iterable[RoundReport], present: Iterable[str], time: float) -> "Moment":
        """The moment after this one; whose report has arrived was here, even if it has left since.

        Args:
            arrived: reports since, in order.
            present: who is here now.
            time: now [Unix s].
        """
        fresh = {report.agent: report for report in arrived}
        here = frozenset(present) | fresh.keys()
        reports = {agent: r for agent, r in {**self.reports, **fresh}.items() if agent in here}
        round_ = max((report.round for report in reports.values()), default=self.round)
        return Moment(round_, time, here, reports)


@dataclass(frozen=True, slots=True)
class Links:
    """The communication graph as it was used.

    Attributes:
        used: edges whose ends mixed each other's parameters.
        missing: edges that did not, though the topology or an end of them had reckoned with it.
    """

    used: tuple[Edge, ...] = ()
    missing: tuple[Edge, ...] = ()


@dataclass(frozen=True, slots=True)
class Event:
    """A line of the log."""

    level: Literal["INFO", "WARN"]
    text: str


def links(config: SwarmFile, moment: Moment) -> Links:
    """Which edges carried parameters.

    When an agent is not here the edges of the full topology at it are missing; the others close
    ranks over the topology of those that are here.
    """
    members = set(config.members)
    planned = {edge(*ends) for ends in graph(config.topology, config.members).edges}
    missing = {ends for ends in planned if not moment.present.issuperset(ends)}
    reports = moment.reports.values()
    missing |= {edge(report.agent, other) for report in reports for other in report.missing}
    heard = {edge(report.agent, other) for report in reports for other in report.weights}
    used, lost = (
        tuple(sorted(ends for ends in edges if members.issuperset(ends)))
        for edges in (heard - missing, missing)
    )
    return Links(used, lost)


def errors(moment: Moment) -> dict[str, float]:
    """Each agent's distance from the mean of all; empty unless all their reports have sketches."""
    sketches = {agent: report.sketch for agent, report in moment.reports.items()}
    return sketch_errors(sketches) if all(sketches.values()) else {}


def distances(moment: Moment, edges: Iterable[Edge]) -> dict[Edge, float]:
    """How far apart the ends of these edges are, of those whose reports have sketches."""
    sketches = {agent: np.array(report.sketch) for agent, report in moment.reports.items()}
    return {
        (a, b): float(np.linalg.norm(sketches[a] - sketches[b]))
        for a, b in edges
        if a in sketches and b in sketches and 0 < sketches[a].size == sketches[b].size
    }


def events(before: Moment, now: Moment, rounds: int) -> list[Event]:
    """What is worth a line; ``rounds`` is how many the swarm plays."""
    lines = []
    if 0 <= now.round < before.round:
        lines.append(Event("WARN", f"the swarm goes on from round {now.round}"))
    lines += [Event("INFO", f"{agent} joined") for agent in sorted(now.present - before.present)]
    for agent in sorted(before.present - now.present):
        last = before.reports[agent].round if agent in before.reports else None
        if last is None:
            lines.append(Event("WARN", f"{agent} left before its first report"))
        elif last + 1 >= rounds:
            lines.append(Event("INFO", f"{agent} finished"))
        else:
            lines.append(Event("WARN", f"{agent} left after round {last}"))
    for agent in sorted(now.reports):
        earlier, report = before.reports.get(agent), now.reports[agent]
        was, missing = set(earlier.missing if earlier else ()), set(report.missing)
        lines += [Event("WARN", f"{agent} mixed without {who}") for who in sorted(missing - was)]
        back = sorted(was.intersection(report.weights))
        lines += [Event("INFO", f"{agent} mixed with {who} again") for who in back]
    return lines


def history(folder: RunFolder, config: SwarmFile) -> list[Moment]:
    """The rounds of a run folder, at most :data:`MOMENTS` of them."""
    return thin(by_round(report for a in config.members for report in folder.reports(a)), MOMENTS)


def remembered(answers: Mapping[str, Sequence[RoundReport]]) -> list[Moment]:
    """The rounds that agents remember, every so many as the most forgetful of them.

    Rounds that not all of them have finished are under way, not missed: they are left out.
    """
    strides = [b.round - a.round for kept in answers.values() for a, b in pairwise(kept[:2])]
    stride = max(strides, default=1)
    done = min((kept[-1].round for kept in answers.values() if kept), default=-1)
    reports = (report for kept in answers.values() for report in kept)
    return by_round(r for r in reports if r.round % stride == 0 and r.round <= done)


def by_round(reports: Iterable[RoundReport]) -> list[Moment]:
    """A moment for each round."""
    rounds: dict[int, list[RoundReport]] = {}
    for report in reports:
        rounds.setdefault(report.round, []).append(report)
    return [Moment.of(rounds[round_]) for round_ in sorted(rounds)]


def thin(moments: Sequence[Moment], limit: int) -> list[Moment]:
    """At most ``limit`` moments: evenly spread, but first those with more to tell than numbers."""
    if len(moments) <= limit:
        return list(moments)
    telling = _spread([i for i, p in enumerate(pairwise(moments), 1) if _tells(*p)], limit // 2)
    even = _spread(range(len(moments)), limit - len(telling))
    return [moments[i] for i in sorted({*telling, *even})]


def _tells(before: Moment, now: Moment) -> bool:
    """Whether there are sketches, or others are here or missing than before."""
    return now.present != before.present or any(
        report.sketch or report.missing != before.reports[agent].missing
        for agent, report in now.reports.items()
    )


def _spread(places: Sequence[int], count: int) -> list[int]:
    """At most ``count`` of ``places``, evenly, with the first and the last."""
    if len(places) <= count:
        return list(places)
    return [places[i] for i in np.linspace(0, len(places) - 1, count).astype(int)]


def edge(a: str, b: str) -> Edge:
    """The edge between two agents."""
    return (a, b) if a < b else (b, a)
