"""Returns and advantages of sampled episodes; time first, any axes after it."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def rewards_to_go(rewards: Floats, gamma: float) -> Floats:
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


def generalized_advantages(
    rewards: Floats,
    values: Floats,
    last_values: Floats,
    active: NDArray[np.bool_],
    gamma: float,
    trace: float,
) -> Floats:
    """GAE (Schulman et al. 2016): ``A_t = delta_t + gamma trace A_{t+1}``.

    ``delta_t = r_t + gamma V(s_{t+1}) - V(s_t)``.  ``trace = 1`` gives ``G_t - V(s_t)``, with what
    is cut off replaced by the critic's word; ``trace = 0`` the one-step error.

    Args:
        rewards: (T, ...) rewards by time.
        values: (T, ...) V(s_t).
        last_values: (...) V of the state after the last step; 0 where the episode terminated.
        active: (T, ...) whether the step was taken.
        gamma: discount factor.
        trace: the lambda of GAE.

    Returns:
        (T, ...) advantages, 0 for steps not taken.
    """
    advantages = np.empty_like(rewards)
    advantage, ahead = np.zeros(rewards.shape[1:]), last_values
    for t in range(len(rewards) - 1, -1, -1):
        surprise = rewards[t] + gamma * ahead - values[t]
        advantage = np.where(active[t], surprise + gamma * trace * advantage, 0.0)
        ahead = np.where(active[t], values[t], last_values)
        advantages[t] = advantage
    return advantages
