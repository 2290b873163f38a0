"""The swarms that the studies run: the settings of the notes to the paper, and random worlds."""

from typing import Any

import msgspec
import numpy as np

from agent.config.experiment import AgentEntry, SwarmFile, Task
from agent.learning.estimators import Reinforce
from agent.learning.optimizers import Sgd
from sim.tabular.gridworld import LAYOUTS
from sim.tabular.mdp import FiniteMDP

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


def random_worlds(
    rng: np.random.Generator, n: int, shape: tuple[int, int], gamma: float, *, shared: bool
) -> list[FiniteMDP]:
    """n worlds of (S, A) with rewards in [0, 1], as the theorems have them; uniform start.

    ``shared``: they differ in their rewards alone (Assumption 2); else in their transitions, too.
    """
    n_states, _ = shape
    probabilities = rng.dirichlet(np.full(n_states, 0.3), size=(1 if shared else n, *shape))
    return [
        FiniteMDP(
            successors=np.broadcast_to(np.arange(n_states), (*shape, n_states)),
            probabilities=probabilities[0 if shared else i],
            rewards=np.repeat(rng.random((*shape, 1)), n_states, axis=2),
            start=np.full(n_states, 1 / n_states),
            terminal=np.zeros(n_states, dtype=np.bool_),
            gamma=gamma,
        )
        for i in range(n)
    ]


def unnamed_agents(n: int) -> tuple[AgentEntry, ...]:
    """Agents whose worlds are handed to the simulator, beside the file."""
    return tuple(AgentEntry(f"drone{i}", Task("given")) for i in range(n))
