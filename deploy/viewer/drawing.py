"""What stands where in a recording, and which rows a moment adds to it.

============================  ================================================================
``worlds/{agent}``            its task: ``path`` is the path most followed, ``drone`` its end;
                              of many agents, those with the same task share one picture
``graph``                     agents, and the edges that carried parameters or failed to
``return/{agent}``            mean return of its round
``distance/{agent}``          mean length of its flights
``consensus_error/{agent}``   distance of its parameters from the mean of all; ``theory`` has more
``edges/{agent}-{agent}``     distance between the parameters of two that mix; in a crowd
                              ``edges/largest`` and ``edges/median`` of these
``disagreement/{agent}``      largest distance from a neighbour's parameters, as it says itself
``events``                    who joined, left, mixed without whom
============================  ================================================================

What flights add stands in ``trails``.

Everything has two times: ``round`` (a number) and ``time`` (wall clock).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, Self

import msgspec
import rerun as rr
import rerun.blueprint as rrb

from agent.config.experiment import SwarmFile
from deploy.viewer import colours, trails
from deploy.viewer.layout import PAGE, blueprint
from deploy.viewer.moments import (
    Edge,
    Event,
    Moment,
    distances,
    edge,
    errors,
    events,
    links,
)
from deploy.viewer.network import Point, drawn, networks, places_of
from deploy.viewer.rooms import Room
from deploy.viewer.rows import Columns, Row, scalars
from deploy.viewer.tasks import CellWorld, world_of
from deploy.viewer.theory import BOUND, DECAY
from swarm.mixing.weights import graph

EDGES = 24  # edges up to which each has a line of its own; of more the largest and the median have
SERIES = ("return", "distance", "consensus_error", "disagreement")  # with a line for each agent
CURVES = {DECAY: ("decay", colours.START), BOUND: ("bound", colours.TROUBLE)}
LARGEST, MEDIAN = "edges/largest", "edges/median"
SUMS = {LARGEST: ("largest", colours.TROUBLE), MEDIAN: ("median", colours.FIRST[0])}


@dataclass(frozen=True, slots=True)
class Scene:
    """What a swarm file tells of the picture.

    Attributes:
        config: the swarm file.
        worlds: by agent, of the tasks that can be drawn.
        sharing: by the first agent of each picture, all that are drawn in it.
        places: by agent, in the graph view.
        colours: by agent, in every view.
    """

    config: SwarmFile
    worlds: dict[str, CellWorld | Room]
    sharing: dict[str, list[str]]
    places: dict[str, Point]
    colours: dict[str, colours.Colour]

    @classmethod
    def of(cls, config: SwarmFile) -> Self:
        """The scene of a swarm."""
        tasks: dict[bytes, list[str]] = {}
        room = len(config.agents) <= PAGE  # for a picture of each agent's own
        for agent in config.agents:
            task = agent.id.encode() if room else msgspec.json.encode(agent.task)
            tasks.setdefault(task, []).append(agent.id)
        worlds: dict[str, CellWorld | Room] = {}
        sharing = {}
        for agents in tasks.values():
            world = world_of(config.agents[config.index(agents[0])].task)
            if world is not None:
                sharing[agents[0]] = agents
                worlds |= dict.fromkeys(agents, world)
        shades = colours.of_agents(len(config.members))
        return cls(
            config, worlds, sharing, places_of(config.members),
            dict(zip(config.members, shades, strict=True)),
        )  # fmt: skip

    def still(self) -> Iterator[tuple[str, rr.AsComponents]]:
        """What is logged once: entity and data."""
        for agent, world in self.worlds.items():
            kept = world.still() if agent in self.sharing else ()
            for name, what in (*kept, *world.moving(self.colours[agent])):
                yield f"worlds/{agent}/{name}", what
        for agent, colour in self.colours.items():
            for plot in SERIES:
                yield f"{plot}/{agent}", rr.SeriesLines(names=[agent], colors=[colour])
        edges = self.edges
        for (a, b), colour in zip(edges, colours.of_agents(len(edges)), strict=True):
            yield f"edges/{a}-{b}", rr.SeriesLines(names=[f"{a} - {b}"], colors=[colour])
        for path, (name, colour) in (CURVES if edges else CURVES | SUMS).items():
            yield path, rr.SeriesLines(names=[name], colors=[colour], widths=[1.0])
        if self.flying:
            yield from trails.still(self.colours)

    @property
    def edges(self) -> list[Edge]:
        """Those that have a line of their own, sorted; none where they are too many."""
        edges = graph(self.config.topology, self.config.members).edges
        return sorted(edge(*ends) for ends in edges) if len(edges) <= EDGES else []

    @property
    def flying(self) -> bool:
        """Whether drones fly in these worlds."""
        return any(isinstance(world, Room) for world in self.worlds.values())

    def rows(self, before: Moment, now: Moment) -> Iterator[Row]:
        """What a moment adds to the one before it."""
        reports = now.reports.items()
        fresh = {a: report for a, report in reports if report is not before.reports.get(a)}
        for agent, report in fresh.items():
            at = (report.round, report.time)
            yield Row(f"return/{agent}", scalars, *at, report.value)
            yield Row(f"disagreement/{agent}", scalars, *at, report.disagreement)
            if report.distance is not None:
                yield Row(f"distance/{agent}", scalars, *at, report.distance)
            world = self.worlds.get(agent)
            if report.route and isinstance(world, CellWorld):
                route = world.centres(report.route)
                yield Row(f"worlds/{agent}/path", strips, *at, route)
                yield Row(f"worlds/{agent}/drone", points, *at, route[-1])
        at = (now.round, now.time)
        for agent, error in errors(now).items() if fresh else ():
            yield Row(f"consensus_error/{agent}", scalars, *at, error)
        found = links(self.config, now)
        apart = distances(now, found.used) if fresh else {}
        if self.edges:
            for (a, b), distance in apart.items():
                yield Row(f"edges/{a}-{b}", scalars, *at, distance)
        elif apart:
            yield Row(LARGEST, scalars, *at, max(apart.values()))
            yield Row(MEDIAN, scalars, *at, median(apart.values()))
        was = before.present, links(self.config, before)
        if apart or (now.present, found) != was:
            network = drawn(self.places, self.colours, now.present, found, apart)
            yield Row("graph", networks, *at, network)
        for event in events(before, now, self.config.rounds):
            yield Row("events", texts, *at, event)

    def blueprint(self) -> rrb.Blueprint:
        """Which view shows what, and where."""
        owners = {agent: self.worlds[agent] for agent in self.sharing}
        return blueprint(owners, self.sharing, self.config.members)


def strips(values: Sequence[Any]) -> Columns:
    """A path (n, 2) a row."""
    return [*rr.LineStrips2D.columns(strips=values)]


def points(values: Sequence[Any]) -> Columns:
    """A point (2,) a row."""
    return [*rr.Points2D.columns(positions=values)]


def texts(values: Sequence[Event]) -> Columns:
    """A line of the log a row."""
    return [
        *rr.TextLog.columns(
            text=[event.text for event in values], level=[event.level for event in values]
        )
    ]
