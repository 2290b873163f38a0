"""The update of Algorithm 1 and its better-known relatives, as pure state machines.

A rule says what an agent sends, and what it makes of the weighted mean of what came back::

    mean_i = sent_i + sum_j W_ij (sent_j - sent_i)        over the edges that carried a message

which is ``sum_j W_ij sent_j`` written so that an edge without a message simply drops out (its
weight stays with the agent) and that a lossy encoding keeps the swarm's mean.  ``step`` is
``alpha g`` (or the step of any optimiser) taken at the agent's own ``theta``.

The exact rules are written with their dual ``y``, whose sum over the swarm must be zero.  What an
edge adds to it at one end it takes away at the other, so it is kept by edge: when a neighbour is
gone, or begins anew, both ends forget that edge's part, and what is left still sums to zero.  So
the rules find the optimum of those who are there, whoever came and went before.

==================  =====================================  ======================================
rule                sends                                  source
==================  =====================================  ======================================
``dcpg``            theta                                  the paper, Eq. 11
``atc``             theta + step                           adapt-then-combine diffusion, Sayed 2014
``exact-diffusion`` theta + step - y                       Yuan et al. 2019 (D2, Tang et al. 2018)
``extra``           theta                                  Shi et al. 2015, in primal-dual form
``gradient-tracking`` [theta, step + y]                    Nedic et al. 2017 (DIGing)
==================  =====================================  ======================================

The single-process simulator and the real swarm run this very code.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarm.mixing.compression import CODECS, Codec, Compression
from swarm.mixing.robust import Robust, shares
from swarm.wire.buffers import Body, sum_of

Vector = NDArray[np.floating]
State = dict[str, Vector]
RuleName = Literal["dcpg", "atc", "exact-diffusion", "extra", "gradient-tracking"]
Missing = Literal["stale", "give-back", "symmetric"]
DUAL = "dual."  # and the neighbour: an edge's part of y in the state
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
    booked: ClassVar[float]  # of a share, on the dual of its edge

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        """What goes to the neighbours in this round."""
        ...

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        """theta of the next round."""
        ...


def dual(state: State, like: Vector) -> Vector:
    """(d,) sum of the edges' duals."""
    total = np.zeros_like(like)
    for name in sorted(state):
        if name.startswith(DUAL):
            total = total + state[name]
    return total


class Dcpg:
    """``theta' = W theta + step``: the paper's Algorithm 1."""

    copies: ClassVar[int] = 1
    sends_after_step: ClassVar[bool] = False
    booked: ClassVar[float] = 0.0

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return theta

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        return sum_of(mean, step)


class AdaptThenCombine:
    """``theta' = W (theta + step)``."""

    copies: ClassVar[int] = 1
    sends_after_step: ClassVar[bool] = True
    booked: ClassVar[float] = 0.0

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return sum_of(theta, step)

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        return mean


class ExactDiffusion:
    """``theta' = W phi`` with ``phi = theta + step - y``, ``y' = y + phi - W phi``.

    ``y`` is what the papers write as ``psi - theta``, with psi the last ``theta + step``.
    """

    copies: ClassVar[int] = 1
    sends_after_step: ClassVar[bool] = True
    booked: ClassVar[float] = -1.0

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return theta + step - dual(state, theta)

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        return mean


class Extra:
    """``theta' = W theta + step - y``, ``y' = y + (theta - W theta) / 2``."""

    copies: ClassVar[int] = 1
    sends_after_step: ClassVar[bool] = False
    booked: ClassVar[float] = -0.5

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return theta

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        return mean + step - dual(state, theta)


class GradientTracking:
    """``theta' = W theta + z`` with ``z = step + y``, ``y' = y + W z - z``: z tracks the mean step.

    ``y`` is what the papers write as ``W z - step``, so ``z' = W z + step' - step``.
    """

    copies: ClassVar[int] = 2
    sends_after_step: ClassVar[bool] = True
    booked: ClassVar[float] = 1.0

    def message(self, theta: Vector, step: Vector, state: State) -> Vector:
        return np.concatenate([theta, step + dual(state, theta)])

    def update(self, theta: Vector, step: Vector, mean: Vector, state: State) -> Vector:
        return mean[: theta.size] + (step + dual(state, theta))


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
        unsettled: the last share of each neighbour, which may have to be taken back.
    """

    config: Mixing
    state: State = field(default_factory=dict)
    heard: dict[str, Vector] = field(default_factory=dict)
    shares: dict[str, Vector] = field(default_factory=dict)
    unsettled: dict[str, Vector] = field(default_factory=dict)
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
        new = self.rule.update(theta, step, mean, self.state)
        for neighbour, share in self.shares.items():
            self._book(neighbour, share, 1.0)
        if self.config.missing == "symmetric":
            self.unsettled |= self.shares
        return new

    def take_back(self, neighbour: str, theta: Vector) -> Vector:
        """theta without the last share of a neighbour, which turned out not to hold ours."""
        share = self.unsettled.pop(neighbour, None)
        if share is None:
            return theta
        self._book(neighbour, share, -1.0)
        return theta - share[: theta.size]

    def forget(self, neighbour: str) -> None:
        """The edge's part of the dual is void, at the other end too."""
        self.state.pop(f"{DUAL}{neighbour}", None)

    def _book(self, neighbour: str, share: Vector, sign: float) -> None:
        """Add a share to the edge's part of the dual, or take it away."""
        if not self.rule.booked or (sign < 0 and f"{DUAL}{neighbour}" not in self.state):
            return
        part = share[share.size - share.size // self.rule.copies :]
        change = part * part.dtype.type(sign * self.rule.booked)
        known = self.state.get(f"{DUAL}{neighbour}")
        self.state[f"{DUAL}{neighbour}"] = change if known is None else known + change
