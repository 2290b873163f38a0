"""What stands where in a recording, and which rows a moment adds to it.

============================  ================================================================
``worlds/{agent}``            its task: ``path`` is the path most followed, ``drone`` its end
``graph``                     agents, and the edges that carried parameters or failed to
``return/{agent}``            mean return of its round
``distance/{agent}``          mean length of its flights
``consensus_error/{agent}``   distance of its parameters from the mean of all; ``theory`` has more
``edges/{agent}-{agent}``     distance between the parameters of two that mix
``disagreement/{agent}``      largest distance from a neighbour's parameters, as it says itself
``events``                    who joined, left, mixed without whom
============================  ================================================================

What flights add stands in ``trails``.

Everything has two times: ``round`` (a number) and ``time`` (wall clock).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import networkx as nx
import rerun as rr
import rerun.blueprint as rrb

from agent.config.experiment import SwarmFile
from deploy.viewer import colours, trails
from deploy.viewer.moments import (
    Edge,
    Event,
    Links,
    Moment,
    distances,
    edge,
    errors,
    events,
    links,
)
from deploy.viewer.rooms import Room
from deploy.viewer.rows import Columns, Row, scalars
from deploy.viewer.tasks import CellWorld, world_of
from deploy.viewer.theory import BOUND, DECAY
from swarm.mixing.weights import graph

CIRCLE = 120.0  # radius on which the agents stand [points of the graph view]
CORNER = rrb.Corner2D.RightTop
PLOTS = {
    "distance": "Mean length of flights [m]",
    "return": "Return",
    "consensus_error": "Consensus error, its decay and bound",
    "edges": "Distance between neighbours",
}
SERIES = ("return", "distance", "consensus_error", "disagreement")  # with a line for each agent
CURVES = {DECAY: ("decay", colours.START), BOUND: ("bound", colours.TROUBLE)}

Point = tuple[float, float]


class Node(NamedTuple):
    """A node of the graph view."""

    name: str
    label: str
    colour: colours.Colour
    place: Point


class Network(NamedTuple):
    """What the graph view shows."""

    nodes: list[Node]
    edges: list[tuple[str, str]]


@dataclass(frozen=True, slots=True)
class Scene:
    """What a swarm file tells of the picture.

    Attributes:
        config: the swarm file.
        worlds: by agent, of the tasks that can be drawn.
        places: by agent, in the graph view.
        colours: by agent, in every view.
    """

    config: SwarmFile
    worlds: dict[str, CellWorld | Room]
    places: dict[str, Point]
    colours: dict[str, colours.Colour]

    @classmethod
    def of(cls, config: SwarmFile) -> Self:
        """The scene of a swarm."""
        worlds = {agent.id: world_of(agent.task) for agent in config.agents}
        circle = nx.circular_layout(config.members, scale=CIRCLE)  # from the right, clockwise
        return cls(
            config,
            {agent: world for agent, world in worlds.items() if world is not None},
            {agent: (float(y), float(-x)) for agent, (x, y) in circle.items()},
            {agent: colours.of_agent(place) for place, agent in enumerate(config.members)},
        )

    def still(self) -> Iterator[tuple[str, rr.AsComponents]]:
        """What is logged once: entity and data."""
        for agent, world in self.worlds.items():
            for name, what in world.still(self.colours[agent]):
                yield f"worlds/{agent}/{name}", what
        for agent, colour in self.colours.items():
            for plot in SERIES:
                yield f"{plot}/{agent}", rr.SeriesLines(names=[agent], colors=[colour])
        edges = graph(self.config.topology, self.config.members).edges
        for place, (a, b) in enumerate(sorted(edge(*ends) for ends in edges)):
            colour = colours.of_agent(place)
            yield f"edges/{a}-{b}", rr.SeriesLines(names=[f"{a} - {b}"], colors=[colour])
        for path, (name, colour) in CURVES.items():
            yield path, rr.SeriesLines(names=[name], colors=[colour], widths=[1.0])
        if self.flying:
            yield from trails.still(self.colours)

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
        for (a, b), distance in apart.items():
            yield Row(f"edges/{a}-{b}", scalars, *at, distance)
        was = before.present, links(self.config, before)
        if apart or (now.present, found) != was:
            yield Row("graph", networks, *at, self.network(now.present, found, apart))
        for event in events(before, now, self.config.rounds):
            yield Row("events", texts, *at, event)

    def network(
        self, present: frozenset[str], found: Links, apart: Mapping[Edge, float]
    ) -> Network:
        """The graph to be drawn.  In the middle of an edge stands how far its ends are apart, or
        that it is missing.
        """
        nodes = [
            Node(agent, agent, self.colours[agent] if agent in present else colours.ABSENT, place)
            for agent, place in self.places.items()
        ]
        said = {ends: (f"{distance:.2g}", colours.START) for ends, distance in apart.items()}
        said |= dict.fromkeys(found.missing, ("missing", colours.TROUBLE))
        edges = [used for used in found.used if used not in said]
        for (a, b), (label, colour) in said.items():
            (ax, ay), (bx, by) = self.places[a], self.places[b]
            middle = Node(f"{a} {b}", label, colour, ((ax + bx) / 2, (ay + by) / 2))
            nodes.append(middle)
            edges += [(a, middle.name), (middle.name, b)]
        return Network(nodes, edges)

    def blueprint(self) -> rrb.Blueprint:
        """Which view shows what, and where."""
        worlds = [world.view(agent, f"worlds/{agent}") for agent, world in self.worlds.items()]
        log = rrb.TextLogView(
            name="Events",
            origin="events",
            columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
        )
        middle = rrb.Vertical(
            rrb.GraphView(name="Who mixes with whom", origin="graph"), log, row_shares=[3, 2]
        )
        shown = [plot for plot in PLOTS if self.flying or plot != "distance"]
        plots = rrb.Vertical(*(_plot(PLOTS[plot], plot) for plot in shown))
        parts = [middle, plots] if not worlds else [rrb.Grid(*worlds), middle, plots]
        if self.flying:
            sights = [
                rrb.Spatial2DView(name=f"{agent} {what}", origin=f"sight/{agent}/{what}")
                for what in ("camera", "depth")
                for agent in self.worlds
            ]
            eyes = rrb.Grid(*sights, grid_columns=len(self.worlds))
            acts = rrb.Horizontal(_plot("Actions", "action"), _plot("Rewards", "reward"))
            parts[0] = rrb.Vertical(parts[0], eyes, acts, row_shares=[5, 3, 2])
        return rrb.Blueprint(
            rrb.Horizontal(*parts, column_shares=[4, 2, 3][-len(parts) :]),
            rrb.TimePanel(state="collapsed", timeline="round", play_state="following"),
            collapse_panels=True,
        )


def _plot(name: str, origin: str) -> rrb.View:
    """A plot of all rounds; by default a live one shows the newest only."""
    ever = rr.TimeRangeBoundary.infinite()
    axis = rrb.TimeAxis(view_range=rr.TimeRange(ever, ever))
    return rrb.TimeSeriesView(name=name, origin=origin, plot_legend=CORNER, axis_x=axis)


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


def networks(values: Sequence[Network]) -> Columns:
    """A graph a row."""
    nodes = [node for network in values for node in network.nodes]
    edges = [edge for network in values for edge in network.edges]
    return [
        *rr.GraphNodes.columns(
            node_ids=[node.name for node in nodes],
            labels=[node.label for node in nodes],
            colors=[node.colour for node in nodes],
            positions=[node.place for node in nodes],
        ).partition([len(network.nodes) for network in values]),
        *rr.GraphEdges.columns(edges=edges).partition([len(network.edges) for network in values]),
    ]
