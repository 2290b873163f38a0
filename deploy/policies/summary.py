"""What a run of networks has come to: the last flights of every agent, from its metrics file."""

import numpy as np
from rich.console import Console
from rich.table import Table

from agent.config.experiment import SwarmFile
from agent.storage.runfolder import RunFolder

LAST = 0.1  # share of the rounds that counts as the end of a run


def print_summary(folder: RunFolder, config: SwarmFile) -> None:
    """Print how every agent did in its own world over the last tenth of its rounds."""
    table = Table(title=f"the last {LAST:.0%} of {config.rounds} rounds, own world, while learning")
    for heading in ("agent", "steps", "flights", "return", "length [m]"):
        table.add_column(heading, justify="left" if heading == "agent" else "right")
    for agent in config.members:
        reports = list(folder.reports(agent))
        last = reports[-max(1, round(LAST * len(reports))) :]
        lengths = [report.distance for report in last if report.distance is not None]
        table.add_row(
            agent,
            f"{last[-1].steps:,}" if last else "0",
            f"{last[-1].episodes:,}" if last else "0",
            f"{np.mean([report.value for report in last]):.3f}" if last else "",
            f"{np.mean(lengths):.1f}" if lengths else "",
        )
    console = Console(highlight=False)
    console.print(table)
    console.print(f"run folder: {folder.path}", soft_wrap=True)
    console.print(f"fly what was learned: swarm eval {folder.path}", soft_wrap=True)
