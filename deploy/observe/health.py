"""What ``swarm status`` finds, as facts: who answers, how they are, and what is wrong.  Pure.

Interface: :func:`judge` turns the agents' answers into a :class:`SwarmStatus`, which is also what
``swarm status --json`` prints.
"""

from collections.abc import Iterator, Mapping
from typing import Literal, Self

import msgspec

from agent.config.experiment import SwarmFile
from deploy.policies.result import Result
from swarm.mixing.consensus import sketch_errors
from swarm.reports.telemetry import AgentStatus, NeighbourStatus

STALE = 5.0  # [s] from a neighbour that has got on meanwhile, an older message means trouble

Health = Literal["healthy", "degraded", "nobody", "ended"]


class AgentFacts(msgspec.Struct, frozen=True, kw_only=True):
    """One agent that answered.

    Attributes:
        state: ``waiting`` for the swarm, ``learning``, ``finished``.
        round, rounds: where it is and where it ends; without common rounds, what it has learned.
        value: mean discounted return of its newest round; None before the first.
        distance: mean length of its flights then [m], where its world tells it.
        consensus_error: its distance from the mean of all parameters, from sketches (9%).
        disagreement: largest distance to a neighbour's parameters, as it says itself.
        neighbours: with whom it exchanges: newest round heard of, and the age of that message [s].
        rejected: messages it refused, by cause.
        quarantined: senders that it has shut out for now.
        one_sided: edges that only one end used in a round, so far.
        memory_mb: resident memory [MB].
        pid, incarnation: of its process.
    """

    state: str
    round: int
    rounds: int
    value: float | None
    distance: float | None
    consensus_error: float | None
    disagreement: float | None
    neighbours: dict[str, NeighbourStatus]
    rejected: dict[str, int]
    quarantined: tuple[str, ...]
    one_sided: int
    memory_mb: float
    pid: int
    incarnation: str

    @classmethod
    def of(cls, answer: AgentStatus, consensus_error: float | None) -> Self:
        """The facts of an answer."""
        shared = {name: getattr(answer, name) for name in cls.__struct_fields__ if name != ERROR}
        return cls(consensus_error=consensus_error, **shared)


ERROR = "consensus_error"  # the one fact that an agent cannot know of itself


class SwarmStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What ``swarm status --json`` prints.

    Attributes:
        swarm: its name.
        health: ``healthy``; ``degraded``: something is wrong; ``nobody`` answers; ``ended``: the
            run of this folder is over, and ``result`` says how.
        problems: what is wrong, a line each; first one for each of ``silent``.
        consensus_error: largest distance of an agent from the mean of all.
        agents: every agent that answered.
        silent: members that did not.
        result: of a run that has ended, what ``result.json`` holds.
    """

    swarm: str
    health: Health
    problems: tuple[str, ...] = ()
    consensus_error: float | None = None
    agents: dict[str, AgentFacts] = {}
    silent: tuple[str, ...] = ()
    result: Result | None = None


def judge(config: SwarmFile, answers: Mapping[str, AgentStatus]) -> SwarmStatus:
    """Sum the answers of a swarm up."""
    silent = tuple(member for member in config.members if member not in answers)
    errors = sketch_errors({name: answer.sketch for name, answer in answers.items()})
    problems = (*(f"{member} does not answer" for member in silent), *_problems(answers))
    return SwarmStatus(
        swarm=config.name,
        health="nobody" if not answers else "degraded" if problems else "healthy",
        problems=problems,
        consensus_error=max(errors.values(), default=None),
        agents={name: AgentFacts.of(a, errors.get(name)) for name, a in sorted(answers.items())},
        silent=silent,
    )


def ended(config: SwarmFile, result: Result) -> SwarmStatus:
    """The status of a run that is over."""
    return SwarmStatus(
        swarm=config.name, health="ended", silent=config.members, result=result,
        problems=(result.cause,) if result.cause else (),
    )  # fmt: skip


def _problems(answers: Mapping[str, AgentStatus]) -> Iterator[str]:
    for name, answer in answers.items():
        for neighbour, heard in answer.neighbours.items():
            if answer.state == "learning" and missed(heard, answers.get(neighbour)):
                yield f"{name} last heard {neighbour} {heard.age:.1f} s ago"
        if answer.state == "waiting" and (why := answer.waiting.get("")):
            yield f"{name} waits: {why}"
        if answer.rejected:
            counts = ", ".join(f"{cause} {n}" for cause, n in sorted(answer.rejected.items()))
            yield f"{name} rejected messages: {counts}"


def missed(heard: NeighbourStatus, itself: AgentStatus | AgentFacts | None) -> bool:
    """Whether a neighbour was not heard though it spoke: a long flight is no trouble."""
    if itself is None or heard.age is None or heard.round is None:
        return False
    return heard.age > STALE and heard.round < itself.round
