"""Every time limit of an agent, and whom it pays to wait for.  Pure: no clock is read here."""

from collections.abc import Collection
from typing import Annotated

import msgspec

Seconds = Annotated[float, msgspec.Meta(gt=0)]
PATIENCE = 4.0  # times what a round usually takes


class Timing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Every wait of an agent [s].

    A round's deadline adapts: :data:`PATIENCE` times what nine of ten recent rounds needed, within
    floor and ceiling.

    Attributes:
        start: for the other agents of the file at the beginning; then it goes on without them.
        round: ceiling of the wait for the neighbours' parameters in one round.
        round_floor: its floor; a machine may stall for a moment.
        resend: until the own parameters are sent again; doubles each time.
        beat: between signs of life while waiting; who gives them is waiting too, not gone.
        state: for a neighbour's newest parameters when joining.
        finish: for the neighbours' last round before leaving.
    """

    start: Annotated[float, msgspec.Meta(ge=0)] = 60.0
    round: Seconds = 30.0
    round_floor: Seconds = 2.0
    resend: Seconds = 0.25
    beat: Seconds = 0.5
    state: Seconds = 2.0
    finish: Seconds = 2.0


def deadline(durations: Collection[float], timing: Timing) -> float:
    """How long a round may take [s], given how long recent ones took from publishing on [s]."""
    if not durations:
        return timing.round
    usual = sorted(durations)[int(0.9 * (len(durations) - 1))]
    return min(max(PATIENCE * usual, timing.round_floor), timing.round)
