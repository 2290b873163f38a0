"""Who exchanges with whom, and with which weight.

A topology is a rule that turns an ordered list of members into an undirected graph, so that every
agent finds its own neighbours from who is present, without asking anybody.  Weights are lazy
Metropolis (Olshevsky 2014; section 5 of the paper): symmetric, doubly stochastic and positive
semidefinite, which Assumption 1 and the step-size bounds need (notes to the paper, 5).
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations
from math import isqrt
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarm.errors import ConfigError

if TYPE_CHECKING:
    import networkx as nx

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
    radius: Annotated[float, msgspec.Meta(gt=0)] = 0.5
    seed: Annotated[int, msgspec.Meta(ge=0)] = 0


def graph(topology: Topology, members: Sequence[str]) -> "nx.Graph":
    """The graph over ``members`` (order matters).  It may be unconnected when some are absent."""
    import networkx as nx  # noqa: PLC0415  (20 MB, which no agent needs)

    joined = nx.Graph()
    joined.add_nodes_from(members)
    joined.add_edges_from(edges(topology, members))
    return joined


def edges(topology: Topology, members: Sequence[str]) -> list[tuple[str, str]]:
    """The edges of :func:`graph`, each once."""
    n = len(members)
    match topology.kind:
        case "ring":
            pairs = [(i, (i + 1) % n) for i in range(n if n > 2 else n - 1)]
        case "path":
            pairs = [(i, i + 1) for i in range(n - 1)]
        case "complete":
            pairs = list(combinations(range(n), 2))
        case "star":
            pairs = [(0, i) for i in range(1, n)]
        case "grid":
            rows = max((d for d in range(1, isqrt(n) + 1) if n % d == 0), default=1)
            width = n // rows
            pairs = [(i, i + 1) for i in range(n) if (i + 1) % width]
            pairs += [(i, i + width) for i in range(n - width)]
        case "exponential":
            hops = [2**k for k in range(n.bit_length()) if 2**k < n]
            pairs = sorted({tuple(sorted((i, (i + hop) % n))) for i in range(n) for hop in hops})
        case "random-geometric":
            import networkx as nx  # noqa: PLC0415

            pairs = list(nx.random_geometric_graph(n, topology.radius, seed=topology.seed).edges)
        case "edges":
            return [(a, b) for a, b in topology.edges if a in members and b in members]
    return [(members[a], members[b]) for a, b in pairs]


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
    parts = _parts(topology, members)
    if len(parts) > 1:
        raise ConfigError(
            f'topology.kind = "{topology.kind}" leaves the graph unconnected: '
            f"{' | '.join(', '.join(part) for part in parts)}; expected one connected graph"
        )


def _parts(topology: Topology, members: Sequence[str]) -> list[list[str]]:
    """Members that hang together."""
    part = {member: {member} for member in members}
    for a, b in edges(topology, members):
        if part[a] is not part[b]:
            part[a] |= part[b]
            for member in part[b]:
                part[member] = part[a]
    return sorted({id(group): sorted(group) for group in part.values()}.values())


@lru_cache(maxsize=256)
def neighbours(topology: Topology, members: tuple[str, ...], me: str) -> tuple[str, ...]:
    """Neighbours of ``me`` among the present ``members``, sorted, without oneself."""
    ends = (edge for edge in edges(topology, members) if me in edge)
    return tuple(sorted({b if a == me else a for a, b in ends}))


def lazy_metropolis(degree: int, other: int) -> float:
    """Weight of the edge between agents of these degrees (oneself not counted).

    ``W_ij = 1 / (2 max(d_i, d_j))``; what is left of 1 stays with the agent itself.
    """
    return 1.0 / (2.0 * max(degree, other))


def weight_matrix(joined: "nx.Graph", members: Sequence[str]) -> NDArray[np.float64]:
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
