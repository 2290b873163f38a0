"""What a joiner may believe: whose state it takes, if anybody's.  Pure.

Every member that is asked answers with its round, the norm of its parameters and its run.  The
joiner takes the parameters that are furthest on among those whose sender is here in the life that
membership knows, and whose run, round and norm another member confirms.  Where only one other
member is here there is nobody else to ask, and its word counts.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from swarm.protocol.messages import ParameterHeader

APART = 64  # rounds that two honest members may be apart while they answer, and
SHARE = 10  # a so-manieth of what they have played: answers take their time
LONGER = 10.0  # times another's norm, or 1, is as large as a believable one


@dataclass(frozen=True, slots=True)
class Answer:
    """One member's state; the protocol does not look into the vector."""

    header: ParameterHeader
    vector: Any


def choose(
    answers: Sequence[Answer], lives: Mapping[str, str], run: str | None, reached: float
) -> Answer | None:
    """The state to go on with, or None: one's own.

    Args:
        answers: of members, each of the norm that it claims.
        lives: of the members who are here.
        run: of the own checkpoint; None if there is none.
        reached: how far the own state is.
    """
    here = [a for a in answers if lives.get(a.header.agent) == a.header.incarnation]
    if run is None:
        votes = Counter(answer.header.run for answer in here if answer.header.phase != "starting")
        run, _ = max(votes.items(), key=lambda vote: (vote[1], vote[0]), default=(None, 0))
    ours = [answer for answer in here if answer.header.run == run]
    believed = [
        answer
        for answer in ours
        if len(lives.keys() & {a.header.agent for a in here}) < 2
        or any(_confirms(other.header, answer.header) for other in ours if other is not answer)
    ]
    best = max(believed, key=lambda answer: reach(answer.header), default=None)
    return best if best is not None and reach(best.header) > reached else None


def reach(header: ParameterHeader) -> float:
    """How far a sender has come: what it has learned, or, where rounds are common, its round."""
    return header.learned or header.round


def _confirms(witness: ParameterHeader, claim: ParameterHeader) -> bool:
    apart = APART + reach(witness) / SHARE
    return reach(claim) <= reach(witness) + apart and claim.norm <= LONGER * max(witness.norm, 1.0)
