"""What a traitor writes into a field of its header: readable, in range, and not true."""

import random
from typing import Any

import msgspec

from swarm.protocol.messages import ParameterHeader, Statement


def lie(
    header: ParameterHeader, field: str, members: tuple[str, ...], last: int, dice: random.Random
) -> ParameterHeader:
    """The header with a lie in one field.

    Args:
        header: the true one.
        field: about what; ``number`` and ``rounds`` are in the statements on its edges.
        members: of the swarm.
        last: number of the last round.
        dice: draws the lie.
    """
    changes: dict[str, Any] = {}
    match field:
        case "round":
            changes["round"] = dice.choice([last, header.round + 1000, 0, last - 1])
        case "norm":
            changes["norm"] = 1e30
        case "neighbours":
            changes["neighbours"] = {member: Statement() for member in members}
        case "number":
            number = dice.randrange(2**53)
            changes["neighbours"] = {member: Statement(number) for member in members}
        case "rounds":
            changes["neighbours"] = {
                member: msgspec.structs.replace(said, rounds=(dice.randrange(500),))
                for member, said in header.neighbours.items()
            }
        case "run":
            changes["run"] = "0" * 16
        case "incarnation":
            changes["incarnation"] = dice.choice(["0" * 16, "f" * 16])
        case "phase":
            changes["phase"] = "finished"
        case "learned":
            changes["learned"] = 1e12
    return msgspec.structs.replace(header, **changes)
