"""A learned policy, out of a run folder or a file, ready to act.

Interface: :meth:`Pilot.load`, :meth:`Pilot.actions`.  A run folder has one set of parameters per
agent; asked for no agent in particular, a pilot flies with their mean, which is what the swarm
agrees upon.  A file is what ``swarm export --format safetensors`` wrote: tensors by name, and in
its header how to build the network.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Self

import msgspec
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from agent.config.experiment import load
from agent.errors import CheckpointError
from agent.learning.flat import FlatNetwork
from agent.learning.networks import available, build
from agent.learning.neural import make_world
from agent.learning.policies import Neural, Tabular
from agent.learning.rollout import Choice, Observations
from agent.storage.files import write_file
from agent.storage.runfolder import open_run
from swarm.errors import ConfigError

Vector = NDArray[np.float32]


class Form(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How to build a policy's network.

    Attributes:
        policy: its settings.
        shape, dtype: of one observation.
        actions: how many there are.
        critic: whether there is a value head.
    """

    policy: Neural
    shape: tuple[int, ...]
    dtype: str
    actions: int
    critic: bool

    def network(self) -> FlatNetwork:
        """The network, its parameters not yet loaded."""
        low, high = (0, 255) if self.dtype == "uint8" else (-np.inf, np.inf)
        seen = spaces.Box(low, high, self.shape, np.dtype(self.dtype).type)
        return FlatNetwork(
            build(available(self.policy), seen, spaces.Discrete(self.actions), self.critic, seed=0)
        )


class Pilot:
    """Acts as a learned policy says.

    Args:
        form: how to build the network.
        theta: (d,) its parameters.
        seed: of stochastic flights.
    """

    def __init__(self, form: Form, theta: Vector, seed: int = 0) -> None:
        form = msgspec.structs.replace(form, policy=available(form.policy))
        self.form, self.theta = form, theta
        self.flat = form.network()
        if theta.size != self.flat.theta.numel():
            raise CheckpointError(
                f"{theta.size} parameters: expected {self.flat.theta.numel()} for {form.policy}"
            )
        self.flat.load(theta)
        self._random = np.random.default_rng(seed)

    @classmethod
    def load(cls, source: Path, agent: str | None = None, seed: int = 0) -> Self:
        """The policy of a run folder (newest checkpoints) or of an exported file.

        Args:
            source: run folder, or ``.safetensors`` file.
            agent: whose parameters of a run folder; None for the mean of all.
            seed: of stochastic actions.

        Raises:
            ConfigError: no run folder, no such agent, or a tabular run.
            CheckpointError: no checkpoint, or one that does not read.
        """
        if source.suffix == ".safetensors":
            form, theta = _read(source)
            return cls(form, theta, seed)
        folder = open_run(source)
        config = load(folder.config)
        if isinstance(config.policy, Tabular):
            raise ConfigError(f'run "{source}" learned a table: expected one of a network')
        if agent is not None:
            config.index(agent)
        members = config.members if agent is None else (agent,)
        world = make_world(config, members[0])
        seen, acts = world.observation_space, world.action_space
        world.close()
        assert isinstance(seen, spaces.Box)
        assert isinstance(acts, spaces.Discrete)
        form = Form(config.policy, seen.shape, str(seen.dtype), int(acts.n), config.mixes_critic)
        thetas = [folder.newest(member).theta for member in members]
        mean = np.asarray(np.mean(thetas, axis=0, dtype=np.float64), np.float32)
        if config.mixes_moments:
            mean = mean[: mean.size // 3]
        return cls(form, mean, seed)

    def actions(self, observations: Observations, greedy: bool) -> NDArray[np.int64]:
        """(N,) actions for N observations: the likeliest ones, or drawn from the policy."""
        return self.choose(observations, greedy).actions

    def choose(self, observations: Observations, greedy: bool) -> Choice:
        """Actions, their log-probabilities and the critic's words."""
        draws = None if greedy else self._random.random(len(observations))
        return self.flat.choose(observations, draws)

    def save(self, path: Path, notes: Mapping[str, str] = MappingProxyType({})) -> None:
        """Write a file that :meth:`load` reads: one tensor per part, the form in the header.

        Args:
            path: where to.
            notes: what else the header is to hold.
        """
        tensors, at = {}, 0
        for name, shape in self.flat.parts:
            size = int(np.prod(shape))
            tensors[name] = self.theta[at : at + size].reshape(shape)
            at += size
        header = {**notes, "form": msgspec.json.encode(self.form).decode()}
        write_file(path, save(tensors, header))


def _read(path: Path) -> tuple[Form, Vector]:
    """Form and parameters of an exported file."""
    try:
        with safe_open(os.fspath(path), framework="numpy") as file:
            form = msgspec.json.decode((file.metadata() or {})["form"], type=Form)
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        names = [name for name, _ in form.network().parts]
        return form, np.concatenate([tensors[name].ravel() for name in names])
    except FileNotFoundError:
        raise CheckpointError(f'no file "{path}"') from None
    except (SafetensorError, msgspec.MsgspecError, KeyError, ValueError, OSError) as error:
        raise CheckpointError(
            f'"{path}" does not read: {error}; expected a file of "swarm export"'
        ) from None


def use_threads(count: int) -> None:
    """Threads of the arithmetic; one is best where several processes fly side by side."""
    torch.set_num_threads(count)
