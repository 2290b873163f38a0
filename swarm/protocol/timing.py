"""Every time limit of an agent, and whom it pays to wait for.  Pure: no clock is read here."""

from collections.abc import Collection, Iterable, Mapping
from typing import Annotated

import msgspec

from swarm.wire.payload import ParameterHeader

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


def awaited(
    round_: int,
    neighbours: Collection[str],
    newest: Mapping[str, int],
    present: Collection[str],
    late: Collection[str],
) -> set[str]:
    """Neighbours whose message of this round may still come.

    Args:
        round_: the round under way.
        neighbours: those of this round.
        newest: newest round heard from each sender.
        present: agents whose token lives.
        late: agents that let a deadline pass and have not caught up since.
    """
    return {
        agent
        for agent in neighbours
        if agent in present and agent not in late and newest.get(agent, -1) < round_
    }


def elsewhere(
    me: str, round_: int, neighbours: Collection[str], views: Iterable[ParameterHeader]
) -> set[str]:
    """Neighbours that exchange this round with others, not with ``me``: they will not answer.

    Args:
        me: own id.
        round_: the round under way.
        neighbours: those of this round.
        views: newest header of each sender.
    """
    return {
        header.agent
        for header in views
        if header.agent in neighbours and header.round >= round_ and me not in header.neighbours
    }


def strangers(
    me: str, round_: int, neighbours: Collection[str], views: Iterable[ParameterHeader]
) -> list[ParameterHeader]:
    """Headers of those who wait for ``me`` in vain, as :func:`elsewhere` has it, and may be told.

    One that is further on finds out by itself, or is told when this agent has come as far.
    """
    return [
        header
        for header in views
        if header.agent not in neighbours and header.round <= round_ and me in header.neighbours
    ]


def out_of_time(
    waiting: Collection[str], heard: Mapping[str, float], published: float, limit: float, now: float
) -> set[str]:
    """Neighbours that have been silent for too long.

    One that waits for somebody else gives signs of life, so a cut-off agent costs its neighbours a
    deadline, and their neighbours nothing.

    Args:
        waiting: for whom.
        heard: when each was heard last [s].
        published: when the own parameters went out [s].
        limit: the round's :func:`deadline` [s].
        now: the time [s].
    """
    if now < published + limit:
        return set()
    return {agent for agent in waiting if now - heard.get(agent, published) >= limit / 2}
