"""``swarm topology``: a swarm file's graph, its weights W, eigenvalues and spectral gap."""

import msgspec
from rich.console import Console
from rich.table import Table

from agent.config.experiment import SwarmFile
from swarm.mixing.weights import graph, spectrum, weight_matrix


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
    table = Table(title=f"{config.topology.kind} of {len(config.members)}: W (lazy Metropolis)")
    table.add_column("")
    for member in config.members:
        table.add_column(member, justify="right")
    for member, row in zip(config.members, W, strict=True):
        table.add_row(member, *(f"{w:.3f}" if w else "." for w in row))
    console.print(table)
    console.print("edges: " + ", ".join(f"{a}-{b}" for a, b in edges))
    console.print("eigenvalues: " + " ".join(f"{v:.4f}" for v in values.eigenvalues))
    console.print(
        f"sigma_2 {values.second:.4f}, spectral gap {values.gap:.4f}, "
        f"smallest eigenvalue {values.smallest:.4f}"
    )
