"""Who exchanges with whom, and with which weight.

A topology is a rule that turns an ordered list of members into an undirected graph, so that every
agent finds its own neighbours from who is present, without asking anybody.  Weights are lazy
Metropolis (Olshevsky 2014; section 5 of the paper): symmetric, doubly stochastic and positive
semidefinite, which Assumption 1 and the step-size bounds need (notes to the paper, 5).
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import msgspec
import networkx as nx
import numpy as np
from numpy.typing import NDArray

from swarm.errors import ConfigError

Kind = Literal[
    "ring", "path", "grid", "complete", "star", "exponential", "random-geometric", "edges"
]


class Topology(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which graph joins the agents.

    Attributes:
        kind: the rule.  ``edges`` takes the list below; ``exponential`` joins members whose places
            differ by a power of two; ``grid`` is the most square lattice.
        edges: pairs of agent ids, for ``kind = "edges"`` only.
        radius: reach of ``random-geometric`` on the unit square.
        seed: places of ``random-geometric``.
    """

    kind: Kind = "ring"
    edges: tuple[tuple[str, str], ...] = ()
    radius: float = 0.5
    seed: int = 0


def graph(topology: Topology, members: Sequence[str]) -> nx.Graph:
    """The graph over ``members`` (order matters).  It may be unconnected when some are absent."""
    ids = tuple(members)
    n = len(ids)
    match topology.kind:
        case "ring":
            shape = nx.cycle_graph(n) if n > 2 else nx.path_graph(n)
        case "path":
            shape = nx.path_graph(n)
        case "complete":
            shape = nx.complete_graph(n)
        case "star":
            shape = nx.star_graph(n - 1) if n else nx.Graph()
        case "grid":
            rows = max(d for d in range(1, int(n**0.5) + 1) if n % d == 0) if n else 0
            lattice = nx.grid_2d_graph(rows, n // rows) if n else nx.Graph()
            shape = nx.convert_node_labels_to_integers(lattice, ordering="sorted")
        case "exponential":
            hops = [2**k for k in range(max(n - 1, 0).bit_length()) if 2**k < n]
            shape = nx.circulant_graph(n, hops) if hops else nx.empty_graph(n)
        case "random-geometric":
            shape = nx.random_geometric_graph(n, topology.radius, seed=topology.seed)
        case "edges":
            named = nx.Graph()
            named.add_nodes_from(ids)
            named.add_edges_from((a, b) for a, b in topology.edges if a in ids and b in ids)
            return named
    return nx.relabel_nodes(shape, dict(enumerate(ids)))


def check(topology: Topology, members: Sequence[str]) -> None:
    """Refuse a graph that cannot agree on anything.

    Raises:
        ConfigError: an edge names a stranger or joins an agent to itself, or the graph over all
            members falls apart.
    """
    if topology.kind == "edges":
        for a, b in topology.edges:
            for end in (a, b):
                if end not in members:
                    raise ConfigError(
                        f'topology.edges names "{end}": expected one of {", ".join(members)}'
                    )
            if a == b:
                raise ConfigError(
                    f'topology.edges joins "{a}" to itself: expected two different agents'
                )
    elif topology.edges:
        raise ConfigError(
            f'topology.edges is given with topology.kind = "{topology.kind}": expected kind "edges"'
        )
    parts = sorted(sorted(part) for part in nx.connected_components(graph(topology, members)))
    if len(parts) > 1:
        raise ConfigError(
            f'topology.kind = "{topology.kind}" leaves the graph unconnected: '
            f"{' | '.join(', '.join(part) for part in parts)}; expected one connected graph"
        )


@lru_cache(maxsize=256)
def neighbours(topology: Topology, members: tuple[str, ...], me: str) -> tuple[str, ...]:
    """Neighbours of ``me`` among the present ``members``, sorted, without oneself."""
    joined = graph(topology, members)
    return tuple(sorted(joined[me])) if me in joined else ()


def lazy_metropolis(degree: int, other: int) -> float:
    """Weight of the edge between agents of these degrees (oneself not counted).

    ``W_ij = 1 / (2 max(d_i, d_j))``; what is left of 1 stays with the agent itself.
    """
    return 1.0 / (2.0 * max(degree, other))


def weight_matrix(joined: nx.Graph, members: Sequence[str]) -> NDArray[np.float64]:
    """The lazy Metropolis matrix W of a graph, rows and columns in the order of ``members``."""
    place = {member: i for i, member in enumerate(members)}
    W = np.zeros((len(place), len(place)))
    for a, b in joined.edges:
        W[place[a], place[b]] = W[place[b], place[a]] = lazy_metropolis(
            joined.degree[a], joined.degree[b]
        )
    np.fill_diagonal(W, 1.0 - W.sum(axis=1))
    return W


class Spectrum(msgspec.Struct, frozen=True):
    """What the convergence bounds need to know of W.

    Attributes:
        eigenvalues: all of them, largest first.
        second: sigma_2, the second largest singular value (0 for one agent).
        smallest: sigma_N, the smallest eigenvalue.
        gap: ``1 - sigma_2``; consensus error shrinks by sigma_2 a round.
    """

    eigenvalues: tuple[float, ...]
    second: float
    smallest: float
    gap: float


def spectrum(W: NDArray[np.float64]) -> Spectrum:
    """Eigenvalues of a symmetric W."""
    values = np.linalg.eigvalsh(W)[::-1]
    values[np.abs(values) < 1e-12] = 0.0  # rounding
    second = float(np.sort(np.abs(values))[-2]) if len(values) > 1 else 0.0
    return Spectrum(tuple(float(v) for v in values), second, float(values[-1]), 1.0 - second)
