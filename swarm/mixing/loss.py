"""Message loss on purpose, the same in the simulator and over a real network.

Whether the message of one sender to one receiver is lost in a round is a fixed function of seed,
round and both names.  Both ends of an edge can compute both directions, so a study may run with
real processes and give the simulator's numbers bit for bit.
"""

import hashlib
from typing import Annotated

import msgspec

from swarm.mixing.rules import Missing


class Loss(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Attributes:
    probability: chance of each message to each receiver to be lost, 0 to 1.
    seed: which messages.
    """

    probability: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.0
    seed: Annotated[int, msgspec.Meta(ge=0)] = 0


def lost(loss: Loss, round_: int, sender: str, receiver: str) -> bool:
    """Whether this message does not arrive."""
    if loss.probability <= 0.0:
        return False
    text = f"{loss.seed}/{round_}/{sender}/{receiver}".encode()
    draw = int.from_bytes(hashlib.blake2b(text, digest_size=8).digest(), "little")
    return draw < loss.probability * 2.0**64


def edge_counts(loss: Loss, missing: Missing, round_: int, sender: str, receiver: str) -> bool:
    """Whether ``receiver`` may use what ``sender`` sent; symmetric drop asks both directions."""
    if lost(loss, round_, sender, receiver):
        return False
    return missing != "symmetric" or not lost(loss, round_, receiver, sender)
