from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from agent.config.experiment import StartMixing, SwarmFile, load
from agent.learning.estimators import A2C, PPO, Exact, Reinforce
from agent.learning.optimizers import Sgd
from agent.learning.tabular import TabularLearner
from deploy.reproduce.rules import many_swarm
from deploy.reproduce.settings import grid_swarm, random_worlds
from deploy.simulate.simulator import DivergenceError, Vectors, simulate, simulate_together
from deploy.simulate.worlds import Worlds
from sim.tabular.gridworld import LAYOUTS
from sim.tabular.mdp import softmax
from swarm.errors import ConfigError
from swarm.memory import Faults, Partition
from swarm.mixing.loss import Loss, edge_counts
from swarm.mixing.rules import Mixer, Mixing
from swarm.mixing.weights import Topology, lazy_metropolis, neighbours

SWARMS = Path(__file__).parents[3] / "deploy" / "library" / "swarms"
SHORT: dict[str, Any] = {"episodes": 3, "horizon": 30}
EXAMPLES: dict[str, SwarmFile] = {
    "dcpg": grid_swarm("a", rounds=6, estimator=Reinforce(**SHORT)),
    "extra, losses": grid_swarm(
        "b", 6, rounds=6, estimator=Reinforce(**SHORT), loss=Loss(0.4, 3),
        mixing=Mixing(rule="extra", missing="symmetric"),
    ),
    "stale, star": grid_swarm(
        "a", 5, rounds=6, estimator=Reinforce(**SHORT), loss=Loss(0.4, 3),
        topology=Topology(kind="star"),
    ),
    "a2c, bytes, d2": grid_swarm(
        "c", rounds=6, estimator=A2C(**SHORT),
        mixing=Mixing(rule="exact-diffusion", compression="int8"),
    ),
    "ppo, halves, tracking": grid_swarm(
        "e", rounds=4, estimator=PPO(**SHORT),
        mixing=Mixing(rule="gradient-tracking", compression="fp16"),
    ),
    "exact, with a step that falls": grid_swarm(
        "a", rounds=6, optimizer=Sgd(step=0.5, decay=0.5), estimator=Exact(),
    ),
    "exact": many_swarm("grid", "dcpg", 6, rounds=5),
}  # fmt: skip


def agents_alone(config: SwarmFile) -> Vectors:
    """Algorithm 1 as agents play it (Rounds), each with a learner and mixer of its own."""
    members = config.members
    learners = [TabularLearner(config, agent) for agent in members]
    mixers = [Mixer(config.mixing) for _ in members]
    nearby = {agent: neighbours(config.topology, members, agent) for agent in members}
    thetas = {agent: x.initial() for agent, x in zip(members, learners, strict=True)}
    for round_ in range(config.rounds):
        steps, sent = {}, {}
        for agent, learner, mixer in zip(members, learners, mixers, strict=True):
            theta = thetas[agent]
            steps[agent] = learner.step(theta, round_).vector
            body = mixer.outgoing(theta, steps[agent])
            sent[agent] = mixer.codec.decode(body, theta.size * mixer.rule.copies, theta.dtype)
        new = {}
        for agent, mixer in zip(members, mixers, strict=True):
            arrived = {
                other: sent[other]
                for other in nearby[agent]
                if edge_counts(config.loss, config.mixing.missing, round_, other, agent)
            }
            weights = {
                n: lazy_metropolis(len(nearby[agent]), len(nearby[n])) for n in nearby[agent]
            }
            new[agent] = mixer.mix(thetas[agent], steps[agent], arrived, weights)
        thetas = new
    return np.stack([thetas[agent] for agent in members])


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_bits_of_agents_that_learn_alone(name: str) -> None:
    config = EXAMPLES[name]
    assert simulate(config).thetas.tobytes() == agents_alone(config).tobytes()


def test_swarms_side_by_side_do_not_touch() -> None:
    common = Reinforce(**SHORT)
    configs = [
        grid_swarm("a", rounds=5, seed=1, estimator=common),
        grid_swarm("b", 6, rounds=5, seed=2, estimator=common, mixing=Mixing(rule="atc")),
        msgspec.structs.replace(
            grid_swarm("d", rounds=5, estimator=common),
            start_mixing=StartMixing(uniform=0.8, rounds=2),
        ),
    ]  # fmt: skip
    for config, run in zip(configs, simulate_together(configs), strict=True):
        alone = simulate(config)
        assert run.thetas.tobytes() == alone.thetas.tobytes()
        np.testing.assert_array_equal(run.consensus, alone.consensus)
        np.testing.assert_allclose(run.values, alone.values, atol=1e-12)
        assert run.values.shape == run.consensus.shape == (5, len(config.agents))


def test_seed_decides_everything() -> None:
    config = EXAMPLES["extra, losses"]
    assert simulate(config).thetas.tobytes() == simulate(config).thetas.tobytes()
    other = msgspec.structs.replace(config, seed=1)
    assert simulate(config).thetas.tobytes() != simulate(other).thetas.tobytes()


def test_swarms_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ConfigError, match="rounds of swarms"):
        simulate_together([grid_swarm("a"), grid_swarm("a", rounds=2)])


def test_who_observes_sees_every_round() -> None:
    seen: list[tuple[int, float]] = []
    config = EXAMPLES["dcpg"]
    run = simulate(
        config, observe=lambda r, thetas: seen.append((r, float(np.abs(thetas[0]).sum())))
    )
    assert [round_ for round_, _ in seen] == list(range(config.rounds + 1))
    assert seen[0][1] == 0
    assert seen[-1][1] == float(np.abs(run.thetas).sum())


def test_a_partition_keeps_groups_apart_and_heals() -> None:
    config = many_swarm("ring", "dcpg", 8, rounds=160)
    config = msgspec.structs.replace(config, optimizer=Sgd(step=1e-9))  # agreement alone
    members = config.members
    gap = Partition(0, 59, (members[:4], members[4:]))
    start = np.repeat([0.0, 1.0], 4)[:, None] * np.ones((8, 100))
    run = simulate(config, faults=Faults(partitions=(gap,)), initial=start)
    np.testing.assert_allclose(run.consensus[:60], 5.0, atol=1e-5)  # sqrt(100) / 2
    assert run.consensus[-1].max() < 1e-3


def test_divergence_has_a_name() -> None:
    config = many_swarm("ring", "dcpg", 4, rounds=3)
    with pytest.raises(DivergenceError, match="round 0"):
        simulate(config, initial=np.full((4, 100), np.inf))


def test_late_messages_slow_the_agreement_down() -> None:
    config = many_swarm("ring", "dcpg", 8, rounds=60)
    assert (
        simulate(config, faults=Faults(delay=3)).consensus[-1].max()
        > simulate(config).consensus[-1].max()
    )


def test_batched_worlds_say_what_each_says_alone() -> None:
    rng = np.random.default_rng(0)
    grids = [model.with_start(rng.dirichlet(np.ones(100))) for model in LAYOUTS["c"].models()]
    for models in (grids, random_worlds(rng, 5, (6, 3), 0.8, shared=False)):
        shape = (len(models), models[0].n_states, models[0].n_actions)
        policies = softmax(2 * rng.normal(size=shape))
        values, gradients = Worlds(models).gradients(policies, 0.03)
        for model, policy, value, gradient in zip(models, policies, values, gradients, strict=True):
            assert value == pytest.approx(model.value(policy), abs=1e-13)
            np.testing.assert_allclose(gradient, model.gradient(policy, 0.03), rtol=0, atol=1e-14)
        np.testing.assert_array_equal(Worlds(models).values(policies), values)


@pytest.mark.parametrize(
    "file",
    sorted([*SWARMS.glob("chain-*.toml"), *SWARMS.glob("gridworld-*.toml")]),
    ids=lambda file: file.stem,
)
def test_swarm_files_of_the_studies_can_be_simulated(file: Path) -> None:
    config = load(file, ["rounds=1"])
    assert np.isfinite(simulate(config).thetas).all()
