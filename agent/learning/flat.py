"""A network whose parameters are one vector, as they travel and as they are mixed.

The vector is float32; the network computes with a copy in the type and the memory layout that are
fastest (:func:`agent.learning.networks.compute_type`).  The optimiser's steps are taken on the
vector, so that steps smaller than bfloat16 can tell add up all the same.
"""

from collections.abc import Iterable
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agent.learning.networks import PolicyNetwork
from agent.learning.optimizers import Optimizer, Sgd
from agent.learning.rollout import Choice, Observations

Vector = NDArray[np.float32]
Parts = tuple[tuple[str, tuple[int, ...]], ...]


class FlatNetwork:
    """Ties a network to a vector.

    Attributes:
        network: computes; its weights follow :attr:`theta` on :meth:`refresh`.
        theta: (d,) float32 parameters.
        gradient: (d,) float32, of the last :meth:`differentiate`.
    """

    def __init__(self, network: PolicyNetwork) -> None:
        self.network = network
        named = dict(network.named_parameters())
        self._weights: list[Tensor] = list(named.values())
        self.parts: Parts = tuple((name, tuple(w.shape)) for name, w in named.items())
        self.device = self._weights[0].device
        size = sum(w.numel() for w in self._weights)
        self.theta = torch.empty(size, device=self.device)
        self.gradient = torch.empty(size, device=self.device)
        self._theta_views = self._views(self.theta)
        self._gradient_views = self._views(self.gradient)
        with torch.no_grad():
            torch._foreach_copy_(self._theta_views, self._weights)

    def _views(self, vector: Tensor) -> list[Tensor]:
        parts = torch.split(vector, [w.numel() for w in self._weights])
        return [part.view(w.shape) for part, w in zip(parts, self._weights, strict=True)]

    def load(self, theta: Vector) -> None:
        """Take on parameters (d,)."""
        self.theta.copy_(torch.from_numpy(theta))
        self.refresh()

    def refresh(self) -> None:
        """Let the network compute with :attr:`theta` as it is now."""
        with torch.no_grad():
            torch._foreach_copy_(self._weights, self._theta_views)

    def choose(self, observations: Observations, draws: NDArray[np.float64] | None) -> Choice:
        """What the policy does about N observations.

        Args:
            observations: (N, ...) as the environment gives them.
            draws: (N,) numbers in [0, 1) that draw the actions; None takes the likeliest.
        """
        with torch.inference_mode():
            logits, values = self.network(torch.from_numpy(observations).to(self.device))
            log_probs = torch.log_softmax(logits, -1).cpu().numpy()
        if draws is None:
            actions = log_probs.argmax(1)
        else:
            below = np.exp(log_probs, dtype=np.float64).cumsum(1)
            actions = (below < draws[:, None] * below[:, -1:]).sum(1)
        chosen = np.take_along_axis(log_probs, actions[:, None], 1)[:, 0]
        return Choice(actions, chosen, values.cpu().numpy())

    def differentiate(self, objectives: Iterable[Tensor], longest: float) -> float:
        """Fill :attr:`gradient` with that of a sum, shortened to ``longest`` (0: as it is).

        The terms come one after the other, so that no more than one of them is in memory.

        Returns:
            Its length before.
        """
        self.gradient.zero_()
        for objective in objectives:
            parts = [g.float() for g in torch.autograd.grad(objective, self._weights)]
            torch._foreach_add_(self._gradient_views, parts)
        length = float(self.gradient.norm())
        if 0 < longest < length:
            self.gradient.mul_(longest / length)
        return length


class FlatAscent:
    """The optimiser for the steps of one round, on a network's vector.

    Args:
        config: which one.
        flat: whose :attr:`~FlatNetwork.theta` climbs along :attr:`~FlatNetwork.gradient`.
        state: what :meth:`state` gave after the last round; left as it is.
    """

    def __init__(self, config: Optimizer, flat: FlatNetwork, state: dict[str, Vector]) -> None:
        self._flat = flat
        self._optimizer: torch.optim.Optimizer
        if isinstance(config, Sgd):
            self._optimizer = torch.optim.SGD([flat.theta], config.step, maximize=True)
            return
        betas = (config.beta1, config.beta2)
        self._optimizer = torch.optim.Adam(
            [flat.theta], config.step, betas, config.epsilon, maximize=True, fused=True
        )
        if "count" in state:
            self._optimizer.state[flat.theta] = {
                "step": torch.tensor(float(state["count"][0]), device=flat.device),
                "exp_avg": torch.tensor(state["first"], device=flat.device),
                "exp_avg_sq": torch.tensor(state["second"], device=flat.device),
            }

    def step(self) -> None:
        """Climb, and let the network follow."""
        self._flat.theta.grad = self._flat.gradient
        self._optimizer.step()
        self._flat.theta.grad = None
        self._flat.refresh()

    def state(self) -> dict[str, Vector]:
        """What must be kept until the next round: names as in
        :class:`agent.learning.optimizers.Ascent`."""
        kept = self._optimizer.state.get(self._flat.theta, {})
        if "exp_avg" not in kept:
            return {}
        return {
            "count": np.array([float(kept["step"])], np.float32),
            "first": cast(Vector, kept["exp_avg"].cpu().numpy()),
            "second": cast(Vector, kept["exp_avg_sq"].cpu().numpy()),
        }
