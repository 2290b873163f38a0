"""Four real processes over real Zenoh compute Algorithm 1, to the last bit."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from agent.config.experiment import load
from agent.learning.tabular import TabularLearner
from swarm.mixing.rules import Mixer
from swarm.mixing.weights import graph, neighbours, weight_matrix
from tests.integration.harness import (
    GRIDWORLD_A,
    MEMBERS,
    agent_pids,
    final_thetas,
    rounds_played,
    run,
    swarm,
    until,
)

pytestmark = pytest.mark.integration
# Without faults: a machine so busy that an agent stands still for seconds would make one.
NO_FAULTS = ["network.lease_ms=30000", "timing.round_floor=60", "timing.round=60"]


def reference(settings: list[str]) -> np.ndarray:
    """Algorithm 1 in one process, with the agents' own mixing and learning code."""
    config = load(GRIDWORLD_A, settings)
    ids = config.members
    W = weight_matrix(graph(config.topology, ids), ids)
    learners = {m: TabularLearner(config, m) for m in ids}
    mixers = {m: Mixer(config.mixing) for m in ids}
    thetas = {m: learners[m].initial() for m in ids}
    for round_ in range(config.rounds):
        steps = {m: learners[m].step(thetas[m], round_).vector for m in ids}
        sent = {
            m: mixers[m].codec.decode(
                mixers[m].outgoing(thetas[m], steps[m]), thetas[m].size, thetas[m].dtype
            )
            for m in ids
        }
        mixed = {}
        for i, m in enumerate(ids):
            nearby = neighbours(config.topology, ids, m)
            weights = {n: float(W[i, ids.index(n)]) for n in nearby}
            arrived = {n: sent[n] for n in nearby}
            mixed[m] = mixers[m].mix(thetas[m], steps[m], arrived, weights)
        thetas = mixed
    return np.stack([thetas[m] for m in ids])


def matrix_form(settings: list[str]) -> np.ndarray:
    """``Theta <- W Theta + alpha G(Theta)`` in float64, independent of the mixing code."""
    config = load(GRIDWORLD_A, settings)
    W = weight_matrix(graph(config.topology, config.members), config.members)
    learners = [TabularLearner(config, m) for m in config.members]
    thetas = np.stack([learner.initial() for learner in learners]).astype(np.float64)
    for round_ in range(config.rounds):
        steps = [
            learner.step(t, round_).vector for learner, t in zip(learners, thetas, strict=True)
        ]
        thetas = W @ thetas + np.stack(steps)
    return thetas


def up(folder: Path, settings: list[str]) -> np.ndarray:
    arguments = [word for setting in settings for word in ("--set", setting)]
    code, output = run(
        "up", GRIDWORLD_A, "--run", folder, "--no-record", *arguments, cwd=folder.parent
    )
    assert code == 0, output
    return final_thetas(folder)


def test_exact_gradients_in_float64_agree_with_the_matrix_form_to_1e_12(tmp_path: Path) -> None:
    settings = [*NO_FAULTS, "rounds=60", "estimator={kind='exact'}", "policy.precision=float64"]
    thetas = up(tmp_path / "run", settings)
    assert thetas.dtype == np.float64
    assert np.abs(thetas).max() > 0.1  # it did learn
    np.testing.assert_allclose(thetas, matrix_form(settings), rtol=0, atol=1e-12)


@pytest.mark.parametrize("estimator", ["exact", "reinforce"])
def test_float32_agrees_with_the_reference_bit_for_bit(tmp_path: Path, estimator: str) -> None:
    settings = [*NO_FAULTS, "rounds=60", f"estimator={{kind='{estimator}'}}"]
    thetas = up(tmp_path / "run", settings)
    assert thetas.dtype == np.float32
    np.testing.assert_array_equal(thetas, reference(settings))


def test_timing_does_not_change_a_bit(tmp_path: Path) -> None:
    """One run undisturbed, one in which an agent is stopped for a while in the middle."""
    settings = [*NO_FAULTS, "rounds=400", "seed=3"]
    first = up(tmp_path / "first", settings)
    second = tmp_path / "second"
    arguments = [word for setting in settings for word in ("--set", setting)]
    with swarm(
        "up", GRIDWORLD_A, "--run", second, "--no-record", *arguments, cwd=tmp_path
    ) as command:
        until(lambda: rounds_played(second, "drone2") > 20, "round 20")
        pid = agent_pids(second)["drone2"]
        os.kill(pid, signal.SIGSTOP)
        others = [m for m in MEMBERS if m != "drone2"]
        try:
            # They run into the missing answer and wait: not for long, or the lease would end it.
            held = dict.fromkeys(others, -1)

            def standing() -> bool:
                now = {m: rounds_played(second, m) for m in others}
                same = now == held
                held.update(now)
                return same

            until(standing, "the others wait")
        finally:
            os.kill(pid, signal.SIGCONT)
        assert command.wait() == 0, command.output
    np.testing.assert_array_equal(final_thetas(second), first)
