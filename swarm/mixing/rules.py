"""The update of Algorithm 1 and its better-known relatives, as pure state machines.

A rule says what an agent sends, and what it makes of the weighted mean of what came back::

    mean_i = sent_i + sum_j W_ij (sent_j - sent_i)        over the edges that carried a message

which is ``sum_j W_ij sent_j`` written so that an edge without a message simply drops out (its
weight stays with the agent) and that a lossy encoding keeps the swarm's mean.  ``step`` is
``alpha g`` (or the step of any optimiser) taken at the agent's own ``theta``.

==================  =====================================  ======================================
rule                sends                                  source
==================  =====================================  ======================================
``dcpg``            theta                                  the paper, Eq. 11
``atc``             theta + step                           adapt-then-combine diffusion, Sayed 2014
``exact-diffusion`` psi' + theta - psi, psi' = theta+step  Yuan et al. 2019 (D2, Tang et al. 2018)
``extra``           theta                                  Shi et al. 2015, in primal-dual form
``gradient-tracking`` [theta, y]                           Nedic et al. 2017 (DIGing)
==================  =====================================  ======================================

The single-process simulator and the real swarm run this very code.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarm.mixing.compression import CODECS, Body, Codec, Compression
from swarm.mixing.robust import Robust, shares
from swarm.wire.vectors import sum_of

Vector = NDArray[np.floating]
State = dict[str, Vector]
RuleName = Literal["dcpg", "atc", "exact-diffusion", "extra", "gradient-tracking"]
Missing = Literal["stale", "give-back", "symmetric"]
EXACT: tuple[RuleName, ...] = ("exact-diffusion", "extra", "gradient-tracking")


class Mixing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How agents agree.

    Attributes:
        rule: see the table above.
        missing: what counts in place of a neighbour's message that did not come: ``symmetric``
            nothing, on both sides of the edge, so that the swarm's mean is kept; ``stale`` the last
            one heard; ``give-back`` nothing, on this side.
        compression: encoding on the wire.
        robust: how far to trust neighbours.
    """

    rule: RuleName = "dcpg"
    missing: Missing = "symmetric"
    compression: Compression = "none"
    robust: Robust = Robust()


class Rule(Protocol):
    """One row of the table.  ``state`` holds the vectors that live from round to round."""

    copies: ClassVar[int]  # vectors per message
    sends_after_step: ClassVar[bool]  # else the exchange hides under the gradient's computation

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        """What goes to the neighbours in this round."""
        ...

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        """theta of the next round; replaces entries of ``state``, never writes into them."""
        ...

    def retract(self, theta: Vector, share: Vector, state: State) -> Vector:
        """theta without ``share``, which an earlier mean should not have held."""
        ...


class Dcpg:
    """``theta' = W theta + step``: the paper's Algorithm 1."""

    copies: ClassVar[int] = 1
    sends_after_step: ClassVar[bool] = False

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return theta

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        return sum_of(mean, step)

    def retract(self, theta: Vector, share: Vector, state: State) -> Vector:
        return theta - share


class AdaptThenCombine:
    """``theta' = W (theta + step)``."""

    copies: ClassVar[int] = 1
    sends_after_step: ClassVar[bool] = True

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return sum_of(theta, step)

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        return mean

    def retract(self, theta: Vector, share: Vector, state: State) -> Vector:
        return theta - share


class ExactDiffusion:
    """``theta' = W (theta + step + theta - psi)`` with ``psi`` the last ``theta + step``."""

    copies: ClassVar[int] = 1
    sends_after_step: ClassVar[bool] = True

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        adapted = theta + step
        return adapted + (theta - state["psi"]) if "psi" in state else adapted

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        state["psi"] = theta + step
        return mean

    def retract(self, theta: Vector, share: Vector, state: State) -> Vector:
        return theta - share


class Extra:
    """``theta' = W theta + step - y``, ``y' = y + (theta - W theta) / 2``.

    The sum of all ``y`` stays zero as long as the weights used on both sides of each edge agree,
    which is why this form wants the symmetric drop and diverges on stale copies.
    """

    copies: ClassVar[int] = 1
    sends_after_step: ClassVar[bool] = False

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return theta

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        dual = state.get("y")
        new = mean + step if dual is None else mean + step - dual
        moved = (theta - mean) * theta.dtype.type(0.5)
        state["y"] = moved if dual is None else dual + moved
        return new

    def retract(self, theta: Vector, share: Vector, state: State) -> Vector:
        state["y"] = state["y"] + share * theta.dtype.type(0.5)
        return theta - share


class GradientTracking:
    """``theta' = W theta + y`` with ``y = W y- + step - step-``, which tracks the mean step."""

    copies: ClassVar[int] = 2
    sends_after_step: ClassVar[bool] = True

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return np.concatenate([theta, self._tracker(step, state)])

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        tracker = self._tracker(step, state)
        state["tracked"] = mean[theta.size :]
        state["step"] = step
        return mean[: theta.size] + tracker

    def retract(self, theta: Vector, share: Vector, state: State) -> Vector:
        state["tracked"] = state["tracked"] - share[theta.size :]
        return theta - share[: theta.size]

    @staticmethod
    def _tracker(step: Vector, state: State) -> Vector:
        return state["tracked"] + step - state["step"] if "step" in state else step


RULES: dict[RuleName, type[Rule]] = {
    "dcpg": Dcpg,
    "atc": AdaptThenCombine,
    "exact-diffusion": ExactDiffusion,
    "extra": Extra,
    "gradient-tracking": GradientTracking,
}


@dataclass(slots=True)
class Mixer:
    """One agent's side of the agreement: rule, encoding and memory.

    Attributes:
        config: the swarm's choice.
        state: vectors that a checkpoint must keep (the rule's own, and ``feedback``).
        heard: the last vector of each neighbour, for ``missing = "stale"``.
        shares: what each neighbour added to the mean of the last round.
    """

    config: Mixing
    state: State = field(default_factory=dict)
    heard: dict[str, Vector] = field(default_factory=dict)
    shares: dict[str, Vector] = field(default_factory=dict)
    rule: Rule = field(init=False)
    codec: Codec = field(init=False)
    _sent: Vector | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.rule = RULES[self.config.rule]()
        self.codec = CODECS[self.config.compression]()

    def outgoing(self, theta: Vector, step: Vector) -> Body:
        """The body to publish; ``step`` is read only by rules that send after it."""
        message = self.rule.message(theta, step, self.state)
        if not self.codec.lossy:
            self._sent = message
            return self.codec.encode(message)
        wanted = message + self.state["feedback"] if "feedback" in self.state else message
        body = self.codec.encode(wanted)
        self._sent = self.codec.decode(body, message.size, message.dtype)
        self.state["feedback"] = wanted - self._sent
        return body

    def mix(
        self,
        theta: Vector,
        step: Vector,
        arrived: Mapping[str, Vector],
        weights: Mapping[str, float],
    ) -> Vector:
        """theta of the next round.

        Args:
            theta: (d,) the agent's own parameters in this round.
            step: (d,) the optimiser's step taken at ``theta``.
            arrived: vectors of this round by sender, already without what must not count.
            weights: W_ij of every neighbour of this round, arrived or not.
        """
        sent, stale = self._sent, self.config.missing == "stale"
        if sent is None:
            raise RuntimeError("mix() before outgoing()")
        # What the rule means by its own message; differs from `sent` by the encoding's error.
        mean = self.rule.message(theta, step, self.state)
        differences = {}
        for neighbour in sorted(weights):  # one fixed order: sums are the same bit for bit
            vector = arrived.get(neighbour)
            if vector is not None:
                if stale:
                    self.heard[neighbour] = vector
            elif stale:
                vector = self.heard.get(neighbour)
            if vector is not None:
                differences[neighbour] = vector - sent
        self.shares = shares(self.config.robust, differences, weights)
        for share in self.shares.values():
            mean = mean + share
        return self.rule.update(theta, step, mean, self.state)
