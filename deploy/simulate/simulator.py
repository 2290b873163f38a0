"""N agents in one process: the rounds of :mod:`agent.daemon.rounds` without processes or network.

One :class:`swarm.mixing.rules.Mixer` per agent, the optimiser and gradients of
:mod:`agent.learning.tabular`, the same random numbers; only the flights are batched, over all
agents of all swarms under way.  The parameters of a swarm file are those that real processes arrive
at, bit for bit.

Interface: :func:`simulate` for one swarm, :func:`simulate_together` for several (seeds, rules,
graphs) at little more than the price of one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from agent.config.experiment import SwarmFile
from agent.learning.estimators import Exact
from agent.learning.optimizers import Ascent
from agent.learning.policies import softmax
from agent.learning.tabular import anywhere, build_model, draw_uniforms, parts_of, sampled_step
from deploy.simulate.worlds import Worlds
from sim.tabular.episodes import Sampler
from sim.tabular.mdp import FiniteMDP, Floats
from swarm.errors import ConfigError, SwarmError
from swarm.memory import Faults, MemoryExchange
from swarm.mixing.consensus import consensus_errors
from swarm.mixing.rules import Mixer
from swarm.mixing.weights import lazy_metropolis, neighbours

Vectors = NDArray[np.floating]


class DivergenceError(SwarmError):
    """The parameters of a simulated swarm have grown beyond all numbers."""


Observe = Callable[[int, list[Vectors]], None]


@dataclass(frozen=True)
class Run:
    """What became of a simulated swarm of N agents after K rounds.

    Attributes:
        config: its swarm file.
        thetas: (N, d) parameters at the end.
        values: (K, N) mean discounted return of each agent's flights (exact estimator: V_i).
        consensus: (K, N) distance from the mean parameters at the beginning of each round.
    """

    config: SwarmFile
    thetas: Vectors
    values: Floats
    consensus: Floats


def simulate(
    config: SwarmFile,
    *,
    faults: Faults | None = None,
    models: Sequence[FiniteMDP] | None = None,
    initial: Vectors | None = None,
    observe: Observe | None = None,
) -> Run:
    """Play all rounds of one swarm; see :func:`simulate_together`."""
    starts = None if initial is None else [initial]
    worlds = None if models is None else [models]
    return simulate_together(
        [config], faults=faults, models=worlds, initial=starts, observe=observe
    )[0]


def simulate_together(
    configs: Sequence[SwarmFile],
    *,
    faults: Faults | None = None,
    models: Sequence[Sequence[FiniteMDP]] | None = None,
    initial: Sequence[Vectors] | None = None,
    observe: Observe | None = None,
) -> list[Run]:
    """Play all rounds of several swarms side by side.

    Args:
        configs: swarms that share estimator, number of rounds and shape of the worlds; seed, rule,
            graph, step size, loss, start mixing and tasks may differ.
        faults: what goes wrong beside the files' losses.
        models: the agents' worlds by swarm, in place of their tasks.
        initial: (N, d) parameters at the start by swarm, default zeros.
        observe: called with the round and every swarm's (N, d) parameters before each round, and
            once more after the last.

    Raises:
        ConfigError: the swarms do not fit together.
        TaskError: a task cannot be built.
        DivergenceError: the parameters do.
    """
    common = configs[0]
    for config in configs[1:]:
        for key in ("estimator", "rounds", "policy"):
            if getattr(config, key) != getattr(common, key):
                raise ConfigError(
                    f'{key} of swarms "{config.name}" and "{common.name}" differ: '
                    "expected swarms that can be simulated together"
                )
    if models is None:
        models = [build_models(config) for config in configs]
    fleet = Fleet(configs, models)
    swarms = [MixingSwarm(config, faults) for config in configs]
    if initial is None:
        size = sum(int(np.prod(shape)) for _, shape in parts_of(common, models[0][0]))
        initial = [np.zeros((len(config.agents), size)) for config in configs]
    thetas = [np.asarray(start, common.policy.precision) for start in initial]
    values: list[Floats] = []
    consensus: list[list[Floats]] = []
    for round_ in range(common.rounds):
        if observe is not None:
            observe(round_, thetas)
        stacked = np.concatenate(thetas)
        if not np.isfinite(stacked).all():
            raise DivergenceError(f"round {round_}: parameters are not finite")
        steps, value = fleet.step(stacked, round_)
        values.append(value)
        consensus.append([consensus_errors(theta) for theta in thetas])
        thetas = [
            swarm.mix(round_, theta, steps[part])
            for swarm, theta, part in zip(swarms, thetas, fleet.parts, strict=True)
        ]
    if observe is not None:
        observe(common.rounds, thetas)
    table = np.stack(values)
    return [
        Run(config, theta, table[:, part], np.stack([errors[i] for errors in consensus]))
        for i, (config, theta, part) in enumerate(zip(configs, thetas, fleet.parts, strict=True))
    ]


class MixingSwarm:
    """The communicating half of one swarm: N mixers over an exchange in memory."""

    def __init__(self, config: SwarmFile, faults: Faults | None) -> None:
        members = config.members
        nearby = {agent: neighbours(config.topology, members, agent) for agent in members}
        self._members = members
        self._mixers = [Mixer(config.mixing) for _ in members]
        self._weights = [
            {
                other: lazy_metropolis(len(nearby[agent]), len(nearby[other]))
                for other in nearby[agent]
            }
            for agent in members
        ]
        self._exchange = MemoryExchange(nearby, config.loss, config.mixing.missing, faults)

    def mix(self, round_: int, thetas: Vectors, steps: Vectors) -> Vectors:
        """Parameters (N, d) of the next round."""
        for agent, mixer, theta, step in zip(
            self._members, self._mixers, thetas, steps, strict=True
        ):
            body = mixer.outgoing(theta, step)
            size = theta.size * mixer.rule.copies
            self._exchange.publish(round_, agent, mixer.codec.decode(body, size, theta.dtype))
        return np.stack(
            [
                mixer.mix(theta, step, self._exchange.gather(round_, agent), weights)
                for agent, mixer, theta, step, weights in zip(
                    self._members, self._mixers, thetas, steps, self._weights, strict=True
                )
            ]
        )


class Fleet:
    """The learning half of all swarms: M agents fly, estimate and step together.

    Attributes:
        parts: where each swarm's agents stand among the M.
    """

    def __init__(self, configs: Sequence[SwarmFile], models: Sequence[Sequence[FiniteMDP]]) -> None:
        ends = np.cumsum([len(config.agents) for config in configs]).tolist()
        self.parts = [slice(end - len(c.agents), end) for c, end in zip(configs, ends, strict=True)]
        self._configs, self._models = configs, models
        self._estimator = configs[0].estimator
        self._seeds = [(c.seed, i) for c in configs for i in range(len(c.agents))]
        self._ascents = [Ascent(config.optimizer) for config in configs]
        self._mixed: list[bool] | None = None  # which swarms start anywhere at present

    def step(self, thetas: Vectors, round_: int) -> tuple[Vectors, Floats]:
        """(M, d) steps taken at ``thetas``, and (M,) what the agents' policies were worth."""
        self._prepare(round_)
        for ascent, config in zip(self._ascents, self._configs, strict=True):
            ascent.config = config.optimizer_at(round_)
        n_states, n_actions = self._models[0][0].n_states, self._models[0][0].n_actions
        logits = thetas[:, : n_states * n_actions].reshape(-1, n_states, n_actions)
        policies, estimator = softmax(logits), self._estimator
        if isinstance(estimator, Exact):
            values, gradients = self._worlds.gradients(policies, estimator.entropy_weight)
            flat = gradients.reshape(len(thetas), -1).astype(thetas.dtype)
            return self._ascend(flat), values
        uniforms = np.stack(
            [
                draw_uniforms(seed, agent, round_, estimator.episodes, estimator.horizon)
                for seed, agent in self._seeds
            ]
        )
        flown = self._sampler(policies, uniforms)
        steps, _ = sampled_step(thetas, policies, flown, estimator, self._ascend)
        discounts = estimator.gamma ** np.arange(len(flown.rewards))
        return steps, np.asarray(np.tensordot(discounts, flown.rewards.mean(axis=2), 1))

    def _ascend(self, gradients: Vectors) -> Vectors:
        return np.concatenate(
            [
                ascent.step(gradients[part])
                for ascent, part in zip(self._ascents, self.parts, strict=True)
            ]
        )

    def _prepare(self, round_: int) -> None:
        """Have the tables of this round's worlds ready; start mixing changes them, rarely."""
        mixed = [round_ < config.start_mixing.rounds for config in self._configs]
        if mixed == self._mixed:
            return
        self._mixed = mixed
        worlds = [
            cast(FiniteMDP, anywhere(model, config.start_mixing.uniform)) if mix else model
            for config, models, mix in zip(self._configs, self._models, mixed, strict=True)
            for model in models
        ]
        if isinstance(self._estimator, Exact):
            self._worlds = Worlds(worlds)
        else:
            self._sampler = Sampler(worlds)


def build_models(config: SwarmFile) -> list[FiniteMDP]:
    """The model of every agent's task; agents of one task share it."""
    built: dict[bytes, FiniteMDP] = {}
    models = []
    for agent in config.agents:
        task = msgspec.json.encode(agent.task)
        if task not in built:
            built[task] = cast(FiniteMDP, build_model(config, agent.id))
        models.append(built[task])
    return models
