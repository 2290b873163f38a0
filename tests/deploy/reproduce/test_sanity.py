"""Every estimator learns grid world (a): all four tasks, by every agent's policy, over 5 seeds."""

import pytest

from agent.learning.estimators import A2C, PPO, Reinforce, Sampled
from deploy.policies.scoring import Referee
from deploy.reproduce.settings import grid_swarm
from deploy.simulate.simulator import simulate_together

ROUNDS = 700
COMMON = {"gamma": 0.99, "entropy_weight": 0.03, "episodes": 10, "horizon": 200}


@pytest.mark.parametrize(
    "estimator",
    [Reinforce(**COMMON), A2C(**COMMON), PPO(**COMMON)],  # type: ignore[arg-type]
    ids=["reinforce", "a2c", "ppo"],
)
def test_every_task_is_solved(estimator: Sampled) -> None:
    configs = [grid_swarm("a", seed=seed, estimator=estimator, rounds=ROUNDS) for seed in range(5)]
    referee = Referee(configs[0])
    for run in simulate_together(configs):
        scores = referee.judge(run.thetas)
        assert scores.solved.min() == 4
        assert scores.share.min() > 0.85
