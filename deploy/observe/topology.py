"""``swarm topology``: a swarm file's graph, its weights W, eigenvalues and spectral gap.

The matrix is shown where it fits 80 columns; of a larger one how often each weight stands in it,
and whom each agent exchanges with.  ``--json`` has all of it.
"""

from collections import Counter

import msgspec
import networkx as nx
import numpy as np
from numpy.typing import NDArray
from rich.columns import Columns
from rich.console import Console
from rich.table import Table
from rich.text import Text

from agent.config.experiment import SwarmFile
from deploy.observe import crowd
from swarm.mixing.weights import graph, spectrum, weight_matrix

KINDS = 6  # different weights that are counted one by one
ENDS = 4  # eigenvalues that are shown from either end of a longer list


def show_topology(config: SwarmFile, as_json: bool) -> None:
    """Print edges, W, its eigenvalues and the spectral gap of a file's graph."""
    joined = graph(config.topology, config.members)
    W = weight_matrix(joined, config.members)
    values = spectrum(W)
    edges = sorted(tuple(sorted(edge)) for edge in joined.edges)
    if as_json:
        summary = {
            "kind": config.topology.kind,
            "members": config.members,
            "edges": edges,
            "W": W.tolist(),
            "spectrum": values,
        }
        print(msgspec.json.format(msgspec.json.encode(summary), indent=2).decode())
        return
    console = Console(highlight=False)
    many = len(config.members) > crowd.MANY
    kind = config.topology.kind
    console.print(f"{kind} of {len(config.members)} agents: {_shape(joined)}")
    table = _matrix(W, config.members)
    if many or console.measure(table).minimum > console.width:
        console.print(f"W (lazy Metropolis): {_weights(W, joined)}")
        console.print("who exchanges with whom:")
        cells = [Text(f"{member}: {' '.join(sorted(joined[member]))}") for member in config.members]
        console.print(Columns(cells, padding=(0, 2)))
    else:
        console.print("W (lazy Metropolis)")
        console.print(table)
        console.print("edges: " + ", ".join(f"{a}-{b}" for a, b in edges))
    console.print("eigenvalues: " + _few([f"{v:.4f}" for v in values.eigenvalues], many))
    console.print(
        f"sigma_2 {values.second:.4f}, spectral gap {values.gap:.4f}, "
        f"smallest eigenvalue {values.smallest:.4f}"
    )


def _shape(joined: nx.Graph) -> str:
    """Numbers of edges and of neighbours, and how far the farthest two are from each other."""
    degrees = [degree for _, degree in joined.degree]
    nearby = str(degrees[0]) if len(set(degrees)) == 1 else f"{min(degrees)} to {max(degrees)}"
    edges = joined.number_of_edges()
    return (
        f"{edges} {'edge' if edges == 1 else 'edges'}, "
        f"{nearby} {'neighbour' if nearby == '1' else 'neighbours'} each, "
        f"diameter {nx.diameter(joined)}"
    )


def _matrix(W: NDArray[np.float64], members: tuple[str, ...]) -> Table:
    table = Table()
    table.add_column("")
    for member in members:
        table.add_column(member, justify="right", no_wrap=True)
    for member, row in zip(members, W, strict=True):
        table.add_row(member, *(f"{w:.3f}" if w else "." for w in row))
    return table


def _weights(W: NDArray[np.float64], joined: nx.Graph) -> str:
    """How often each weight stands on an edge, and what agents keep of themselves."""
    upper = W[np.triu_indices(len(W), 1)]
    on_edges = Counter(np.round(upper[upper > 0], 4).tolist())
    own = np.round(np.diag(W), 4)
    if len(on_edges) > KINDS:
        said = f"{min(on_edges):.3f} to {max(on_edges):.3f} on {joined.number_of_edges()} edges"
    else:
        said = ", ".join(f"{weight:.3f} on {n} edges" for weight, n in sorted(on_edges.items()))
    kept = f"{own.min():.3f}" if np.ptp(own) == 0 else f"{own.min():.3f} to {own.max():.3f}"
    return f"{said}; of itself each keeps {kept}"


def _few(words: list[str], many: bool) -> str:
    """All words, or those at both ends."""
    if not many or len(words) <= 2 * ENDS:
        return " ".join(words)
    return f"{' '.join(words[:ENDS])} ... {' '.join(words[-ENDS:])}"
