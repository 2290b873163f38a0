"""Cart-poles that differ in gravity and in the length of the pole: a small family of tasks."""

from typing import Any, cast

import numpy as np
from gymnasium import spaces
from gymnasium.envs.classic_control.cartpole import CartPoleEnv


class CartPoleVariant(CartPoleEnv):
    """Gymnasium's ``CartPole-v1`` with its constants as arguments.

    ## Description
    A pole stands on a cart; pushes keep it up.  After Barto, Sutton and Anderson 1983.

    ## Observation Space
    ``Box(4)``, float32: position [m], velocity [m/s], angle [rad], angular velocity [rad/s].

    ## Action Space
    ``Discrete(2)``: push left, push right.

    ## Rewards
    1 for every step.

    ## Starting State
    All four numbers even between -0.05 and 0.05.

    ## Episode End
    Terminated when the pole leans more than 12 degrees or the cart leaves 2.4 m either side;
    truncated after 500 steps (registration).

    ## Arguments
    ``gravity`` [m/s^2], 9.8; ``pole`` length of the pole [m], 1.0.
    """

    def __init__(self, gravity: float = 9.8, pole: float = 1.0, **kwargs: Any) -> None:
        if gravity <= 0 or pole <= 0:
            raise ValueError(f"gravity = {gravity}, pole = {pole}: expected numbers above 0")
        super().__init__(**kwargs)
        self.metadata = {"render_modes": []}  # drawing needs pygame
        space = cast(spaces.Box, self.observation_space)
        high = np.minimum(space.high, np.finfo(np.float32).max)
        self.observation_space = spaces.Box(-high, high, dtype=np.float32)
        self.gravity = gravity
        self.length = pole / 2
        self.polemass_length = self.masspole * self.length
