"""What stands where in a recording, and which rows a moment adds to it.

============================  ================================================================
``worlds/{agent}``            its task: ``path`` is the path most followed, ``drone`` its end
``graph``                     agents, and the edges that carried parameters or failed to
``return/{agent}``            mean return of its round
``consensus_error/{agent}``   distance of its parameters from the mean of all
``disagreement/{agent}``      largest distance from a neighbour's parameters
``events``                    who joined, left, mixed without whom
============================  ================================================================

Everything has two times: ``round`` (a number) and ``time`` (wall clock).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import networkx as nx
import rerun as rr
import rerun.blueprint as rrb

from agent.config import SwarmFile
from deploy.viewer import colours
from deploy.viewer.moments import Event, Links, Moment, errors, events, links
from deploy.viewer.worlds import CellWorld, world_of

CIRCLE = 120.0  # radius on which the agents stand [points of the graph view]
PLOTS = {
    "return": ("Return", rrb.Corner2D.RightBottom),
    "consensus_error": ("Consensus error", rrb.Corner2D.RightTop),
    "disagreement": ("Largest distance from a neighbour", rrb.Corner2D.RightTop),
}

Point = tuple[float, float]
Columns = list[rr.ComponentColumn]


class Row(NamedTuple):
    """One value of an entity; ``draw`` turns a list of such values into columns."""

    path: str
    draw: Callable[[Sequence[Any]], Columns]
    round: int
    time: float
    value: Any


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
    worlds: dict[str, CellWorld]
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
            for plot in PLOTS:
                yield f"{plot}/{agent}", rr.SeriesLines(names=[agent], colors=[colour])

    def rows(self, before: Moment, now: Moment) -> Iterator[Row]:
        """What a moment adds to the one before it."""
        reports = now.reports.items()
        fresh = {a: report for a, report in reports if report is not before.reports.get(a)}
        for agent, report in fresh.items():
            at = (report.round, report.time)
            yield Row(f"return/{agent}", scalars, *at, report.value)
            yield Row(f"disagreement/{agent}", scalars, *at, report.disagreement)
            if report.route and agent in self.worlds:
                route = self.worlds[agent].centres(report.route)
                yield Row(f"worlds/{agent}/path", strips, *at, route)
                yield Row(f"worlds/{agent}/drone", points, *at, route[-1])
        at = (now.round, now.time)
        for agent, error in errors(now).items() if fresh else ():
            yield Row(f"consensus_error/{agent}", scalars, *at, error)
        network = self.network(now.present, links(self.config, now))
        if network != self.network(before.present, links(self.config, before)):
            yield Row("graph", networks, *at, network)
        for event in events(before, now, self.config.rounds):
            yield Row("events", texts, *at, event)

    def network(self, present: frozenset[str], found: Links) -> Network:
        """The graph to be drawn.  A missing edge is broken: a small node stands in its middle."""
        agents = [
            Node(agent, agent, self.colours[agent] if agent in present else colours.ABSENT, place)
            for agent, place in self.places.items()
        ]
        breaks, halves = [], []
        for a, b in found.missing:
            (ax, ay), (bx, by) = self.places[a], self.places[b]
            middle = Node(f"{a} {b}", "missing", colours.TROUBLE, ((ax + bx) / 2, (ay + by) / 2))
            breaks.append(middle)
            halves += [(a, middle.name), (middle.name, b)]
        return Network(agents + breaks, [*found.used, *halves])

    def blueprint(self) -> rrb.Blueprint:
        """Which view shows what, and where."""
        worlds = [world.view(agent, f"worlds/{agent}") for agent, world in self.worlds.items()]
        middle = rrb.Vertical(
            rrb.GraphView(name="Who mixes with whom", origin="graph"),
            rrb.TextLogView(
                name="Events",
                origin="events",
                columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
            ),
            row_shares=[3, 2],
        )
        ever = (
            rr.TimeRangeBoundary.infinite()
        )  # by default a live plot shows the newest rounds only
        axis = rrb.TimeAxis(view_range=rr.TimeRange(ever, ever))
        plots = rrb.Vertical(
            *(
                rrb.TimeSeriesView(name=name, origin=plot, plot_legend=corner, axis_x=axis)
                for plot, (name, corner) in PLOTS.items()
            )
        )
        parts = [middle, plots] if not worlds else [rrb.Grid(*worlds), middle, plots]
        return rrb.Blueprint(
            rrb.Horizontal(*parts, column_shares=[4, 2, 3][-len(parts) :]),
            rrb.TimePanel(state="collapsed", timeline="round", play_state="following"),
            collapse_panels=True,
        )


def scalars(values: Sequence[float]) -> Columns:
    """A number a row."""
    return [*rr.Scalars.columns(scalars=values)]


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
