"""What a run of networks has come to: the last flights of every agent, from its metrics file."""

import msgspec
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from agent.config.experiment import SwarmFile
from agent.storage.runfolder import RunFolder
from swarm.mixing.consensus import sketch_errors

LAST = 0.1  # share of the rounds that counts as the end of a run
ROWS = 16  # agents up to which the table has a row for each


class LastFlights(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How an agent did in its own world over the last tenth of its rounds, while it learned.

    Attributes:
        steps, episodes: in the whole run.
        value: mean discounted return; None without a round.
        distance: mean length of the flights [m], where the world tells it.
        consensus_error: distance of its last parameters from the mean of all, from sketches.
    """

    steps: int = 0
    episodes: int = 0
    value: float | None = None
    distance: float | None = None
    consensus_error: float | None = None


class NetworkScores(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True,
    tag_field="kind", tag="network",
):  # fmt: skip
    """What every agent's last flights were like; ``swarm eval`` flies again, and longer.

    Attributes:
        agents: by id.
    """

    agents: dict[str, LastFlights]


def network_scores(folder: RunFolder, config: SwarmFile) -> NetworkScores:
    """What the reports of a run tell of its end."""
    reports = {agent: list(folder.reports(agent)) for agent in config.members}
    errors = sketch_errors({a: played[-1].sketch for a, played in reports.items() if played})
    flights = {}
    for agent, played in reports.items():
        if not played:
            flights[agent] = LastFlights()
            continue
        last = played[-max(1, round(LAST * len(played))) :]
        lengths = [report.distance for report in last if report.distance is not None]
        flights[agent] = LastFlights(
            steps=last[-1].steps,
            episodes=last[-1].episodes,
            value=float(np.mean([report.value for report in last])),
            distance=float(np.mean(lengths)) if lengths else None,
            consensus_error=errors.get(agent),
        )
    return NetworkScores(agents=flights)


def print_network(scores: NetworkScores, rounds: int, console: Console) -> None:
    """A row for each agent; of many, for those that did worst, and what all did."""
    console.print(f"the last {LAST:.0%} of {rounds} rounds, own world, while learning")
    table = Table()
    table.add_column("agent", overflow="fold")
    for heading in ("steps", "flights", "return", "length [m]"):
        table.add_column(escape(heading), justify="right")
    rows = list(scores.agents.items())
    if len(rows) > ROWS:
        rows.sort(key=lambda row: (row[1].distance or 0.0, row[1].value or 0.0))
        table.caption = f"the {ROWS} that did worst of {len(rows)}; all: result.json"
    for agent, last in rows[:ROWS]:
        table.add_row(
            agent,
            f"{last.steps:,}",
            f"{last.episodes:,}",
            "" if last.value is None else f"{last.value:.3f}",
            "" if last.distance is None else f"{last.distance:.1f}",
        )
    console.print(table)
