import numpy as np
import pytest

from agent.learning.policies import softmax
from deploy.policies.scoring import Referee
from deploy.policies.tables import tabular_scores
from deploy.reproduce.examples import trap_swarm
from deploy.reproduce.settings import grid_swarm
from sim.tabular.gridworld import LAYOUTS


def test_scores_are_what_each_world_says_alone() -> None:
    config = grid_swarm("a", 8)  # two agents a task
    thetas = np.random.default_rng(1).normal(size=(3, 400 + 100))  # values behind the logits
    referee = Referee(config)
    scores, result = referee.judge(thetas), tabular_scores(config, thetas)
    assert referee.tasks.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    models = LAYOUTS["a"].models()
    for theta, value in zip(thetas, scores.value, strict=True):
        policy = softmax(theta[:400].reshape(100, 4))
        assert value == pytest.approx(sum(2 * model.value(policy) for model in models), abs=1e-12)
    assert (scores.goal + scores.obstacle <= 1 + 1e-12).all()
    np.testing.assert_array_equal(result.value, scores.value)
    np.testing.assert_array_equal(result.goal, scores.goal.repeat(2, axis=0))
    np.testing.assert_array_equal(result.obstacle, scores.obstacle.repeat(2, axis=0))
    assert result.solved == (2 * scores.solved).tolist()
    assert result.optimum == referee.optimum.bound
    assert scores.share == pytest.approx(scores.value / referee.optimum.bound)


def test_an_optimum_that_nobody_knows_is_none() -> None:
    config = trap_swarm("dcpg", 0.5, 1, 0.75, 0.9)  # moves by chance, differently in each task
    assert tabular_scores(config, np.zeros((2, 10))).optimum is None
