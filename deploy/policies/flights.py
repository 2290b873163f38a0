"""Flights of a learned policy that teach it nothing: how far it gets, world by world.

Interface: :func:`fly_quota`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import msgspec
import numpy as np

from agent.learning.rollout import Choice, Observations
from deploy.flying.quota import Quota


class Flown(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One flight.

    Attributes:
        value: sum of its rewards.
        steps: taken.
        distance: [m], from ``info["distance"]``; None where the world does not tell.
        capped: whether it was still flying at the most steps.
    """

    value: float
    steps: int
    distance: float | None
    capped: bool


def fly_quota(
    envs: Sequence[gymnasium.Env[Any, Any]],
    act: Callable[[Observations], Choice],
    flights: int,
    most_steps: int,
    seed: int,
    tell: Callable[[float], None] = lambda share: None,
) -> list[Flown]:
    """Fly ``flights`` flights in each of several worlds, a batch of observations at a time.

    Args:
        envs: the worlds.
        act: the policy.
        flights: of every world.
        most_steps: of a flight.
        seed: of the first world; the others follow.
        tell: called after every step with the share of all that is flown.
    """
    seen = [env.reset(seed=seed + i)[0] for i, env in enumerate(envs)]
    steps, values = [0] * len(envs), [0.0] * len(envs)
    quota = Quota([flights] * len(envs), most_steps)
    flown: list[Flown] = []
    while flying := quota.flying:
        actions = act(np.stack([seen[i] for i in flying])).actions
        for i, action in zip(flying, actions, strict=True):
            seen[i], reward, terminated, truncated, info = envs[i].step(int(action))
            values[i] += float(reward)
            steps[i] += 1
            if terminated or truncated or steps[i] >= most_steps:
                distance = info.get("distance")
                flown.append(
                    Flown(
                        value=values[i],
                        steps=steps[i],
                        distance=None if distance is None else float(distance),
                        capped=not terminated,
                    )
                )
                quota.end(i)
                steps[i], values[i] = 0, 0.0
                seen[i], _ = envs[i].reset()
        tell(quota.share(steps))
    return flown
