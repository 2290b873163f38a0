"""What becomes of a gradient: the step that is added to the mixed parameters."""

from dataclasses import dataclass, field
from typing import Annotated

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

Vector = NDArray[np.floating]
Positive = Annotated[float, msgspec.Meta(gt=0)]
Fraction = Annotated[float, msgspec.Meta(ge=0, lt=1)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
MOMENTS = ("first", "second")  # Adam's, by their names in the optimiser's state


class Sgd(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="sgd"):
    """Plain gradient ascent, ``alpha g``: the paper's Algorithm 1.

    Attributes:
        step: alpha.
        decay: share of the rounds, the last ones, over which the step falls in a line to 0; the
            paper's is constant.
    """

    step: Positive = 0.5
    decay: Share = 0.0


class Adam(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="adam"):
    """Kingma & Ba 2015, with the settings of the paper's drone experiment.

    Attributes:
        step: step size.
        decay: as of :class:`Sgd`.
        beta1, beta2: decay of the first and second moment.
        epsilon: added to the root of the second moment.
        mix_moments: neighbours mix their moments as they mix their parameters
            (:mod:`agent.learning.moments`); messages are three times as long.
    """

    step: Positive = 1e-4
    decay: Share = 0.0
    beta1: Fraction = 0.9
    beta2: Fraction = 0.999
    epsilon: Positive = 1e-8
    mix_moments: bool = False


Optimizer = Sgd | Adam


def decayed(config: Optimizer, round_: int, rounds: int) -> Optimizer:
    """The optimiser of one round, from 0, of so many: its step as :attr:`Sgd.decay` has it."""
    left, falling = rounds - round_, config.decay * rounds
    if not config.decay or left >= falling:  # asynchronous agents play more rounds than there are
        return config
    return replace(config, step=config.step * max(left, 0) / falling)


@dataclass(slots=True)
class Ascent:
    """An optimiser at work.  ``state`` holds what a checkpoint must keep."""

    config: Optimizer
    state: dict[str, Vector] = field(default_factory=dict)

    def step(self, gradient: Vector) -> Vector:
        """The step along ``gradient`` (d,), of the same type; replaces entries of ``state``."""
        kind = gradient.dtype.type
        config = self.config
        if isinstance(config, Sgd):
            return np.asarray(kind(config.step) * gradient)
        zeros = np.zeros_like(gradient)
        count = self.state.get("count", np.zeros(1, gradient.dtype)) + kind(1)
        first = kind(config.beta1) * self.state.get("first", zeros)
        first += kind(1 - config.beta1) * gradient
        second = kind(config.beta2) * self.state.get("second", zeros)
        second += kind(1 - config.beta2) * gradient * gradient
        self.state |= {"count": count, "first": first, "second": second}
        t = float(count[0])
        scale = config.step * np.sqrt(1 - config.beta2**t) / (1 - config.beta1**t)
        epsilon = config.epsilon * np.sqrt(1 - config.beta2**t)
        return np.asarray(kind(scale) * first / (np.sqrt(second) + kind(epsilon)))
