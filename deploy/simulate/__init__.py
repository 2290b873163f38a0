"""A whole swarm of tabular tasks in one process, with the agents' own code.

::

    from pathlib import Path
    from agent.config.experiment import load
    from deploy.simulate import simulate

    run = simulate(load(Path("deploy/library/swarms/gridworld-a.toml"), ["rounds=100"]))
    run.thetas, run.values, run.consensus  # (N, d), (K, N), (K, N)
"""

from deploy.simulate.simulator import DivergenceError, Run, simulate, simulate_together

__all__ = ["DivergenceError", "Run", "simulate", "simulate_together"]
