"""A swarm file: one experiment, as frozen, documented fields.

Defaults in the types <- TOML <- ``--set key=value``.  :func:`load` reads and checks all of it
before anything starts.
"""

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import msgspec
from msgspec.structs import replace

from agent.config.beside import located, look_in, missing, modules_of
from agent.config.kinds import drop_foreign, kinds_in
from agent.config.strict import convert, override, read_toml
from agent.learning.estimators import ActorCritic, Estimator, Exact
from agent.learning.optimizers import Adam, Optimizer, Sgd, decayed
from agent.learning.policies import Policy, Tabular
from swarm.errors import ConfigError
from swarm.mixing.loss import Loss
from swarm.mixing.rules import EXACT, Mixing
from swarm.mixing.weights import Topology, check
from swarm.protocol.quorum import Quorum
from swarm.protocol.timing import Timing
from swarm.wire.endpoints import PORTS, check_host, host_and_port
from swarm.wire.endpoints import endpoint as endpoint_of
from swarm.wire.keys import Keys, check_name
from swarm.wire.security import OBSERVER, Party
from swarm.wire.session import Network

log = logging.getLogger(__name__)
Count = Annotated[int, msgspec.Meta(ge=1)]


class Task(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The world in which an agent trains.

    Attributes:
        env: Gymnasium id, ``module:Name-v0`` to import the module first.
        kwargs: arguments of its constructor.
    """

    env: str
    kwargs: dict[str, Any] = {}


class AgentEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One agent of the swarm.

    Attributes:
        id: unique name, part of its keys.
        task: its world.
        endpoint: where it listens, e.g. ``tcp/10.0.0.7:7447``; default from ``[network]``.
        namespace: network namespace in which ``swarm up`` starts it (root; for tests of networks).
        device: its network device there.
    """

    id: str
    task: Task
    endpoint: str | None = None
    namespace: str | None = None
    device: str | None = None


class StartMixing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Start anywhere at first (tabular tasks): repairs grid world (d).

    Attributes:
        uniform: share of the uniform start distribution over live states, 0 to 1.
        rounds: for so many rounds; then the task's own start only.
    """

    uniform: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.0
    rounds: Annotated[int, msgspec.Meta(ge=0)] = 0


class Training(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a network learns from its flights; a table takes each round whole and needs none of it.

    Attributes:
        worlds: flown side by side, their observations one batch of the network.
        segment: steps of every world in a round.  Actor-critics stop in mid-flight and go on in
            the next round; REINFORCE flies whole flights of so many steps on average.  0: whole
            flights, ``estimator.episodes`` of them.
        reward_scale: rewards are multiplied by it for learning, never in what is reported.
        standardize: returns or advantages of a round are brought to mean 0 and deviation 1.
        minibatch: steps per optimiser step; 0 takes the whole round at once.
        gradient_clip: longest gradient of an optimiser step; 0 for any.
        threads: of the arithmetic; one is best where there are as many agents as cores.
    """

    worlds: Count = 1
    segment: Annotated[int, msgspec.Meta(ge=0)] = 0
    reward_scale: Annotated[float, msgspec.Meta(gt=0)] = 1.0
    standardize: bool = False
    minibatch: Annotated[int, msgspec.Meta(ge=0)] = 0
    gradient_clip: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    threads: Count = 1


class Reached(Protocol):
    """What tells how far an agent has come; see :attr:`SwarmFile.pace`."""

    @property
    def round(self) -> int: ...
    @property
    def learned(self) -> float: ...


class SwarmFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One experiment.

    Attributes:
        name: of the swarm; agents of different names never meet.
        agents: who takes part, with its task.
        estimator: how gradients are estimated.
        seed: of all randomness; same file and seed give the same parameters bit for bit.
        rounds: how long to learn.
        policy: what is learned.
        training: how a network learns from its flights.
        optimizer: what becomes of the gradient.
        mixing: how parameters are agreed upon.
        topology: who exchanges with whom.
        pace: ``sync``: every round waits for the neighbours' parameters of it; ``async``: it takes
            what has come, and waits for nobody's round.  ``rounds`` then counts what is learned:
            who is fast plays more rounds with smaller steps (:mod:`swarm.mixing.staleness`).
        staleness: with ``async``, how far an agent may be ahead of a neighbour [rounds].
        start_mixing: start distribution early on.
        loss: messages lost on purpose.
        network: how agents reach each other.
        timing: every wait.
        quorum: with how few neighbours an agent goes on.
        checkpoint_every: rounds between checkpoints.
        modules: folders in which modules of tasks are looked for after what is installed, from the
            file's; by default, where a task names a module that is not installed, the file's
            folder and the working folder.
    """

    name: str
    agents: Annotated[tuple[AgentEntry, ...], msgspec.Meta(min_length=1)]
    estimator: Estimator
    seed: Annotated[int, msgspec.Meta(ge=0)] = 0
    rounds: Count = 1000
    policy: Policy = Tabular()
    training: Training = Training()
    optimizer: Optimizer = Sgd()
    mixing: Mixing = Mixing()
    topology: Topology = Topology()
    pace: Literal["sync", "async"] = "sync"
    staleness: Annotated[float, msgspec.Meta(ge=1)] = 16.0
    start_mixing: StartMixing = StartMixing()
    loss: Loss = Loss()
    network: Network = Network()
    timing: Timing = Timing()
    quorum: Quorum = Quorum()
    checkpoint_every: Count = 1
    modules: tuple[str, ...] = ()

    @property
    def members(self) -> tuple[str, ...]:
        """All ids, in the file's order: the order in which a topology places them."""
        return tuple(agent.id for agent in self.agents)

    @property
    def mixes_moments(self) -> bool:
        """Whether the optimiser's moments travel with the parameters."""
        return isinstance(self.optimizer, Adam) and self.optimizer.mix_moments

    @property
    def mixes_critic(self) -> bool:
        """Whether there is a value head and it travels with the policy."""
        return isinstance(self.estimator, ActorCritic) and self.estimator.mix_critic

    def optimizer_at(self, round_: int) -> Optimizer:
        """The optimiser of one round, from 0."""
        return decayed(self.optimizer, round_, self.rounds)

    def progress(self, of: Reached) -> float:
        """How far a checkpoint or a report has come on the way to ``rounds``."""
        return of.learned if self.pace == "async" else of.round

    def index(self, agent: str) -> int:
        """Place of an agent in the file.

        Raises:
            ConfigError: there is none of this id.
        """
        if agent not in self.members:
            raise ConfigError(
                f'swarm "{self.name}" has no agent "{agent}": '
                f"expected one of {', '.join(self.members)}"
            )
        return self.members.index(agent)

    def endpoint(self, agent: str) -> str:
        """Where an agent listens."""
        i = self.index(agent)
        own, network = self.agents[i].endpoint, self.network
        return own or endpoint_of(network.protocol, network.host, network.base_port + i)

    def party(self, name: str) -> Party:
        """An agent, or an observer, among the members."""
        return Party(name, Keys(self.name), self.members)


def load(path: Path, settings: Iterable[str] = ()) -> SwarmFile:
    """Read a swarm file (or the ``config.json`` of a run folder) and check all of it.

    Paths in it count from the file and come back absolute; modules that its tasks name and that are
    not installed are found from now on (:mod:`agent.config.beside`).

    Raises:
        ConfigError: one line that names file, key, value and what was expected.
    """
    config = read(read_toml(path), settings, str(path))
    folder, here = path.parent.resolve(), Path.cwd()
    security = config.network.security.beside(path.parent)
    network = replace(config.network, security=security)
    agents = tuple(
        replace(
            agent,
            task=replace(agent.task, kwargs=located(agent.task.kwargs, (folder, here))),
        )
        for agent in config.agents
    )
    modules = tuple(str((folder / place).resolve()) for place in config.modules)
    if missing(modules_of([agent.task.env, agent.task.kwargs] for agent in agents)):
        modules = modules or tuple(dict.fromkeys((str(folder), str(here))))
        look_in(modules)
    return replace(config, network=network, agents=agents, modules=modules)


def read(tables: dict[str, Any], settings: Iterable[str], where: str) -> SwarmFile:
    """The swarm file in ``tables``, which come from ``where``; relative paths are left as they are.

    Raises:
        ConfigError: as :func:`load`.
    """
    settings = tuple(settings)
    before = kinds_in(tables, SwarmFile)
    override(tables, settings)
    chosen = {setting.partition("=")[0] for setting in settings}
    for line in drop_foreign(tables, SwarmFile, before, chosen):
        log.warning("%s", line)
    if isinstance(policy := tables.get("policy"), dict):
        policy.setdefault("kind", "tabular")
    config = convert(tables, SwarmFile, where)
    try:
        check_name("name", config.name)
        for i, agent in enumerate(config.agents):
            check_name(f"agents.{i}.id", agent.id)
            if (first := config.members.index(agent.id)) != i:
                raise ConfigError(
                    f'agents.{i}.id = "{agent.id}" is also the id of agents.{first}: '
                    "expected ids that differ"
                )
        _check_pace(config)
        _check_mixing(config)
        _check_training(config)
        _check_critic(config)
        _check_security(config)
        _check_endpoints(config)
        check(config.topology, config.members)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None
    return config


def _check_pace(config: SwarmFile) -> None:
    """No mixed moments where steps are scaled: they would be no step's; no decay by rounds where
    everybody plays its own number of them."""
    if config.pace == "sync":
        return
    if config.mixes_moments:
        raise ConfigError('optimizer.mix_moments = true: expected pace = "sync" with it')
    if config.optimizer.decay:
        raise ConfigError(
            f'optimizer.decay = {config.optimizer.decay:g}: expected pace = "sync" with it'
        )


def _check_mixing(config: SwarmFile) -> None:
    """Exact rules keep sums that are zero only while both ends of an edge use the same: they
    diverge, or settle elsewhere, where one end may go its own way."""
    mixing = config.mixing
    if mixing.rule not in EXACT:
        return
    what = f'mixing.rule = "{mixing.rule}": expected '
    if mixing.missing != "symmetric":
        raise ConfigError(f'{what}mixing.missing = "symmetric" with it, not "{mixing.missing}"')
    if config.pace != "sync":
        raise ConfigError(f'{what}pace = "sync" with it, not "{config.pace}"')
    if mixing.robust.kind == "trimmed-mean":
        raise ConfigError(f'{what}mixing.robust.kind = "none" or "clip" with it')


def _check_training(config: SwarmFile) -> None:
    """An estimator and settings that fit the policy."""
    if isinstance(config.policy, Tabular):
        if config.training != Training():
            raise ConfigError(
                '[training] is for networks: expected policy.kind = "network" or "c3f2", '
                "or no [training]"
            )
    elif isinstance(config.estimator, Exact):
        raise ConfigError(
            'estimator.kind = "exact" asks the model of a tabular task: expected "reinforce", '
            '"a2c" or "ppo" for a network'
        )


def _check_critic(config: SwarmFile) -> None:
    """A critic that does not travel is a network's, and so are its moments, which do not either."""
    if not isinstance(config.estimator, ActorCritic) or config.mixes_critic:
        return
    if isinstance(config.policy, Tabular):
        raise ConfigError(
            'estimator.mix_critic = false: expected policy.kind = "network" or "c3f2" with it'
        )
    if config.mixes_moments:
        raise ConfigError(
            "optimizer.mix_moments = true: expected estimator.mix_critic = true with it"
        )


def _check_security(config: SwarmFile) -> None:
    """Endpoints and ids that fit ``[network.security]``."""
    tls = config.network.security.tls
    for i, agent in enumerate(config.agents):
        if tls and agent.id == OBSERVER:
            raise ConfigError(
                f'agents.{i}.id = "{OBSERVER}": expected an id that is no observer\'s'
            )
        if agent.endpoint and agent.endpoint.startswith("tls/") != tls:
            wanted = (
                "tls/..., as [network.security] has it" if tls else "tcp/..., or [network.security]"
            )
            raise ConfigError(f'agents.{i}.endpoint = "{agent.endpoint}": expected {wanted}')


def _check_endpoints(config: SwarmFile) -> None:
    """Places where one can listen, and dial."""
    network, count = config.network, len(config.agents)
    check_host("network.host", network.host)
    if network.base_port + count - 1 > PORTS and not all(agent.endpoint for agent in config.agents):
        raise ConfigError(
            f"network.base_port = {network.base_port}: expected at most {PORTS - count + 1} "
            f"for {count} agents"
        )
    given = {"network.listen": network.listen}
    given |= {f"agents.{i}.endpoint": agent.endpoint for i, agent in enumerate(config.agents)}
    for key, text in given.items():
        if text is not None:
            try:
                host_and_port(text)
            except ConfigError as error:
                raise ConfigError(f"{key}: {error}") from None
