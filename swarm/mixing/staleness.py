"""How much to learn now, in a swarm whose agents do not keep in step.  Pure.

Interface: :func:`share_to_learn`.

Every agent counts what it has learned, in rounds: the sum of the shares of its steps that it took.
The count travels with its parameters, and an agent holds its own against its neighbours'.  Who is
ahead takes smaller steps, and none when it is ``bound`` ahead; who is behind takes larger ones, up
to :data:`CATCH_UP` times.  So all tasks weigh the same however unequal the agents' speeds are.  No
agent learns while a neighbour is more than ``bound`` behind; who is waits for news of it.
"""

from collections.abc import Collection

CATCH_UP = 3.0  # times its step is the most that an agent takes


def share_to_learn(own: float, neighbours: Collection[float], bound: float) -> float:
    """By what an agent multiplies its step.

    Args:
        own: what it has learned [rounds].
        neighbours: what each of its neighbours has [rounds].
        bound: how far it may be ahead [rounds].
    """
    lead = own - min(neighbours, default=own)
    behind = max(neighbours, default=own) - own
    share = min(max(behind, 1.0), CATCH_UP)
    return share if lead <= 0 else min(share, max(0.0, 2 * (1 - lead / bound)))
