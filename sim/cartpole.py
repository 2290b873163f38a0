"""Cart-poles that differ in gravity and in the length of the pole: a small family of tasks."""

from typing import Any

from gymnasium.envs.classic_control.cartpole import CartPoleEnv


class CartPoleVariant(CartPoleEnv):
    """Gymnasium's ``CartPole-v1`` with its constants as arguments.

    ## Description, Observation Space, Action Space
    As Gymnasium has them: ``Box(4)`` (position [m], velocity, angle [rad], angular velocity),
    ``Discrete(2)`` (push left, push right).

    ## Rewards
    1 for every step.

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
        self.gravity = gravity
        self.length = pole / 2
        self.polemass_length = self.masspole * self.length
