"""Returns of finished episodes."""

import numpy as np
from numpy.typing import NDArray


def rewards_to_go(rewards: NDArray[np.float64], gamma: float) -> NDArray[np.float64]:
    """Discounted return from each step on.

    Args:
        rewards: (T, ...) rewards by time; zero after an episode's end.
        gamma: discount factor.

    Returns:
        (T, ...) ``G_t = r_t + gamma G_{t+1}``.
    """
    returns = np.empty_like(rewards)
    ahead = np.zeros(rewards.shape[1:])
    for t in range(len(rewards) - 1, -1, -1):
        ahead = rewards[t] + gamma * ahead
        returns[t] = ahead
    return returns
