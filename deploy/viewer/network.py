"""The graph of who mixes with whom, as the viewer draws it.

In the middle of an edge stands how far its ends are apart, or that it is missing.  In a crowd there
is no room for words, which would stand over names: a missing edge is not there, and of ids only
what tells them apart is written.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import NamedTuple

import networkx as nx
import rerun as rr

from deploy.viewer import colours
from deploy.viewer.moments import Edge, Links
from deploy.viewer.rows import Columns

CROWD = 12  # agents from which on there is no room for words
APART = 30.0  # between neighbours on the circle, at least [points of the graph view]
SMALLEST = 120.0  # radius of the circle [points]
DOT, BALL = 3.0, 6.0  # radii of nodes, and of agents in a crowd [points]

Point = tuple[float, float]


class Node(NamedTuple):
    """A node of the graph view."""

    name: str
    label: str
    colour: colours.Colour
    place: Point
    radius: float = DOT


class Network(NamedTuple):
    """What the graph view shows."""

    nodes: list[Node]
    edges: list[tuple[str, str]]


def places_of(members: Sequence[str]) -> dict[str, Point]:
    """Where agents stand: on a circle, from its top clockwise, with room for each."""
    radius = max(SMALLEST, APART * len(members) / (2 * math.pi))
    circle = nx.circular_layout(members, scale=radius)  # from the right, clockwise
    return {agent: (float(y), float(-x)) for agent, (x, y) in circle.items()}


def drawn(
    places: Mapping[str, Point],
    shades: Mapping[str, colours.Colour],
    present: frozenset[str],
    found: Links,
    apart: Mapping[Edge, float],
) -> Network:
    """The graph of a moment.

    Args:
        places, shades: of every agent.
        present: who is here.
        found: which edges were used, and which are missing.
        apart: how far the ends of edges are from each other.
    """
    crowd = len(places) > CROWD
    labels = short(list(places)) if crowd else {agent: agent for agent in places}
    nodes = [
        Node(
            agent, labels[agent], shades[agent] if agent in present else colours.ABSENT, place,
            BALL if crowd else DOT,
        )
        for agent, place in places.items()
    ]  # fmt: skip
    said = {ends: (f"{far:.2g}", colours.START) for ends, far in apart.items()}
    said |= dict.fromkeys(found.missing, ("missing", colours.TROUBLE))
    if crowd:
        said = {}
    edges = [used for used in found.used if used not in said]
    for (a, b), (label, colour) in said.items():
        (ax, ay), (bx, by) = places[a], places[b]
        middle = Node(f"{a} {b}", label, colour, ((ax + bx) / 2, (ay + by) / 2))
        nodes.append(middle)
        edges += [(a, middle.name), (middle.name, b)]
    return Network(nodes, edges)


def short(names: Sequence[str]) -> dict[str, str]:
    """Names without what they all begin with."""
    same = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    shared = len(list(same))
    return {name: name[shared:] or name for name in names}


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
            radii=[node.radius for node in nodes],
        ).partition([len(network.nodes) for network in values]),
        *rr.GraphEdges.columns(edges=edges).partition([len(network.edges) for network in values]),
    ]
