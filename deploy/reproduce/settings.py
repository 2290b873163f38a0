"""The swarms that the studies run: the settings of the notes to the paper, in one place."""

from typing import Any

import msgspec

from agent.config import AgentEntry, SwarmFile, Task
from agent.estimators import Reinforce
from agent.optimizers import Sgd
from sim.tabular.gridworld import LAYOUTS

REINFORCE = Reinforce(gamma=0.99, entropy_weight=0.03, episodes=10, horizon=200)


def grid_agents(layout: str, n_agents: int) -> tuple[AgentEntry, ...]:
    """Agents over the tasks of a layout, in contiguous blocks of one task where there are more."""
    n_tasks = LAYOUTS[layout].n_tasks
    return tuple(
        AgentEntry(f"drone{i}", grid_task(layout, i * n_tasks // n_agents)) for i in range(n_agents)
    )


def grid_task(layout: str, task: int) -> Task:
    """One task of a layout."""
    return Task("sim:GridWorld-v0", {"layout": layout, "task": task})


def grid_swarm(layout: str, n_agents: int | None = None, **changes: Any) -> SwarmFile:
    """The paper's grid-world experiment: DCPG on a ring, one agent a task, REINFORCE."""
    config = SwarmFile(
        name=f"gridworld-{layout}",
        agents=grid_agents(layout, n_agents or LAYOUTS[layout].n_tasks),
        estimator=REINFORCE,
        optimizer=Sgd(step=0.5),
        rounds=1000,
    )
    return msgspec.structs.replace(config, **changes)
