"""The paper's two-task chain S1..S5 (Sec. 2.2): where one policy for two tasks is hard to find.

Example 1 (`modified=False`): the best policy is not deterministic.  Example 2 (`modified=True`):
in S2 and S4 chance decides, and policy gradients may be trapped at a point that is not optimal.
"""

from typing import Any

import numpy as np

from sim.tabular.env import TabularEnv
from sim.tabular.mdp import FiniteMDP

S1, S2, S3, S4, S5 = range(5)
LEFT, RIGHT = range(2)


def chain_model(
    task: int, *, modified: bool = False, p: float = 0.75, gamma: float = 0.99
) -> FiniteMDP:
    """The exact chain: task 1 seeks S1 and shuns S5, task 2 the other way round; starts in S3.

    Example 1: `LEFT` and `RIGHT` move so, but in task 2 they are reversed in S2 and S4.
    Example 2: from S2 and S4, whatever the action, the walk goes right with probability `p` in
    task 1 and with `1 - p` in task 2, else left.
    """
    if task not in {1, 2}:
        raise ValueError(f"task: {task}, expected 1 or 2")
    if not 0 <= p <= 1:
        raise ValueError(f"p: {p}, expected a probability")
    # Of each state and action: the two neighbours, and the chance to go to the right one.
    successors = np.tile(np.arange(5)[:, None, None] + (-1, 1), (1, 2, 1))
    go_right = np.tile((0.0, 1.0), (5, 1))
    if modified:
        go_right[[S2, S4]] = p if task == 1 else 1 - p
    elif task == 2:
        go_right[[S2, S4]] = (1.0, 0.0)
    successors[[S1, S5]] = np.array([S1, S5])[:, None, None]
    payoff = np.zeros(5)
    payoff[[S1, S5]] = (1.0, -1.0) if task == 1 else (-1.0, 1.0)
    rewards = payoff[successors]
    rewards[[S1, S5]] = 0.0
    return FiniteMDP(
        successors=successors,
        probabilities=np.stack([1 - go_right, go_right], axis=-1),
        rewards=rewards,
        start=np.eye(5)[S3],
        terminal=np.isin(np.arange(5), (S1, S5)),
        gamma=gamma,
    )


class Chain(TabularEnv):
    """A walk along five states with a prize at one end and a penalty at the other.

    ## Description
    One task of the paper's two-task chain (Sec. 2.2), in its first or second example.

    ## Observation Space
    `Discrete(5)`: 0..4 for S1..S5 (unitless).

    ## Action Space
    `Discrete(2)`: 0 left, 1 right.  Example 1: in task 2 the two are reversed in S2 and S4.
    Example 2: in S2 and S4 the action does not matter; the walk goes right with probability `p`
    in task 1 and `1 - p` in task 2, else left.

    ## Rewards
    Task 1: +1 on reaching S1, -1 on reaching S5.  Task 2: the reverse.  Else 0.

    ## Starting State
    S3.

    ## Episode End
    Terminates in S1 and S5; truncated after `horizon` steps if that is given.

    ## Arguments
    * `task`: 1 or 2.
    * `modified`: False for example 1, True for example 2; `p`: its probability.
    * `gamma`: discount of the exact model; `horizon`: steps, or None for no limit.
    * `render_mode`: "ansi" (text), or None.

    ## Attributes
    `model` is the exact `FiniteMDP`; `goal_states` and `obstacle_states` are its two ends.
    """

    metadata: dict[str, Any] = {"render_modes": ["ansi"], "render_fps": 4}  # noqa: RUF012  (Gymnasium declares it so)

    def __init__(
        self,
        task: int = 1,
        *,
        modified: bool = False,
        p: float = 0.75,
        gamma: float = 0.99,
        horizon: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        model = chain_model(task, modified=modified, p=p, gamma=gamma)
        goal, obstacle = (S1, S5) if task == 1 else (S5, S1)
        super().__init__(model, [goal], [obstacle], horizon, render_mode)

    def render(self) -> Any:
        """One line, `G.o.#`: goal, drone, obstacle."""
        if self.render_mode is None:
            return None
        symbols = np.full(5, ".")
        symbols[self.goal_states], symbols[self.obstacle_states] = "G", "#"
        symbols[self._state] = "o"
        return "".join(symbols) + "\n"
