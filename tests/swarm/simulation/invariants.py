"""What must hold in every play, and the shortest schedule in which it does not."""

from collections.abc import Callable, Iterator

import numpy as np

from swarm.mixing.rules import DUAL
from swarm.mixing.weights import neighbours
from swarm.protocol.machine import Machine
from swarm.protocol.peers import KEPT
from tests.swarm.simulation.process import Process
from tests.swarm.simulation.schedule import Schedule
from tests.swarm.simulation.world import LEASE, QUORUM, TIMING, World

HEALED = 20  # rounds within which every edge mixes again
LAST = 6  # rounds at the end in which every edge is used
ROUND = 0.45  # [s] that a round takes without a fault, beside two latencies


def play(schedule: Schedule, machine: type[Machine] = Machine) -> World:
    """A world after all faults are over and the swarm has had time to heal."""
    world = World(schedule, machine)
    quiet = ROUND + 2 * (schedule.latency + schedule.jitter)
    world.healed_by = schedule.calm_from + LEASE + TIMING.start + 2 * TIMING.round_floor
    # A traitor goes on holding its neighbours up, each once in a while.
    held_up = 4 * TIMING.round if schedule.traitors else 0.0
    world.run(world.healed_by + HEALED * quiet + held_up)
    return world


def broken(world: World) -> list[str]:
    """What does not hold, in words."""
    return [
        *world.offences,
        *(
            f"{p.agent}: {offence}"
            for p in world.processes
            if p.agent not in world.traitors
            for offence in p.offences
        ),
        *_edges(world),
        *_healing(world),
        *_lives(world),
        *_waits(world),
        *_memory(world),
    ]


def _honest(world: World) -> list[Process]:
    current = (world.current(member) for member in world.members)
    return [p for p in current if p is not None and p.agent not in world.traitors]


def _edges(world: World) -> Iterator[str]:
    """Both ends of an edge keep a round or neither; parameters and duals move by nothing else."""
    honest = _honest(world)
    for p in honest:
        for q in honest:
            if p.agent < q.agent:
                yield from _edge(p, q)
        if p.mixer.config.rule in {"dcpg", "atc"}:
            moved = p.base + p.steps + sum(p.flows.values(), np.zeros_like(p.base))
            if not np.allclose(p.theta, moved, atol=1e-9):
                yield f"{p.agent}: its parameters moved by more than its steps and its edges"


def _edge(p: Process, q: Process) -> Iterator[str]:
    ends = []
    for a, b in ((p, q), (q, p)):
        account = a.machine.peers[b.agent].account
        kept = {r: f for (other, r), f in a.flows.items() if other == f"{b.agent}/{b.life}"}
        ends.append((kept, account))
    (ours, mine), (theirs, its) = ends
    settled = {mine.open, its.open}
    for a, b in ((p, q), (q, p)):  # decided, and done when the round under way is mixed
        settled |= {r for neighbour, r in a.machine.pending if neighbour == b.agent}
    for round_ in (ours.keys() ^ theirs.keys()) - settled:
        yield f"{p.agent}-{q.agent}: round {round_} is kept by one end only"
    for round_ in ours.keys() & theirs.keys():
        if not np.allclose(ours[round_], -theirs[round_], atol=1e-9):
            yield f"{p.agent}-{q.agent}: round {round_} moves the mean"
    if mine.number == its.number and mine.rounds == its.rounds:
        sums = [a.mixer.state.get(DUAL + b.agent, 0.0) for a, b in ((p, q), (q, p))]
        if not np.allclose(sums[0], -sums[1], atol=1e-9):
            yield f"{p.agent}-{q.agent}: their duals do not cancel"


def _healing(world: World) -> Iterator[str]:
    """Every edge between those who are here at the end is used again, and soon.

    But where a traitor tells different members different runs: then they do not agree on who takes
    part, and so on the graph, and mix over the edges that both ends see.
    """
    if any(fault.kind == "lie" and fault.lie == "run" for fault in world.schedule.faults):
        return
    current = {m: p for m in world.members if (p := world.current(m)) is not None}
    here = tuple(current)
    for p in _honest(world):
        nearby = set(neighbours(world.topology, here, p.agent)) - world.traitors
        if p.machine.needed > len(current.keys() - world.traitors) - 1:
            continue  # too few are left: it waits, as it should
        after = [r for r in p.rounds if r[0] >= world.healed_by]
        for other in sorted(nearby):
            when = [i for i, (_, _, used, _) in enumerate(after) if other in used]
            if not when or when[0] > HEALED:
                yield f"{p.agent} does not mix with {other} within {HEALED} rounds"
            elif not any(other in used for _, _, used, _ in after[-LAST:]):
                yield f"{p.agent} does not mix with {other} in the end"


def _lives(world: World) -> Iterator[str]:
    """Of two lives the newer goes on, and the older ends with a line."""
    for member in world.members:
        alive = world.living(member)
        if len(alive) > 1:
            yield f"{member} lives {len(alive)} times"
        latest = max((p for p in world.processes if p.agent == member), key=lambda p: p.life)
        for process in alive:
            if process is not latest and latest.ended:
                yield f"{member}: the older life goes on"
    for process in world.processes:
        if process.ended == "finished":
            yield f"{process.agent} believes that training is over"


def _waits(world: World) -> Iterator[str]:
    """One deadline for a fault; nobody trains alone for longer than its patience."""
    kinds = {fault.kind for fault in world.schedule.faults}
    for p in world.processes:
        if p.agent in world.traitors:
            continue
        if not kinds & {"lossy", "lie"}:
            for cause in {cause for _, cause, _ in p.said if cause.startswith("late/")}:
                told = sum(said == cause for _, said, _ in p.said)
                if told > max(1, len(world.schedule.faults)):
                    yield f"{p.agent} ran {told} times into the deadline of {cause[5:]}"
        since = None
        for at, round_, used, _ in p.rounds:
            if used or not p.machine.needed:
                since = None
            elif since is None:
                since = at
            elif at - since > QUORUM.patience + TIMING.round and not any(
                since <= said <= at and cause == "quorum" for said, cause, _ in p.said
            ):
                yield f"{p.agent} trains alone in round {round_}"
                break


def _memory(world: World) -> Iterator[str]:
    for p in world.processes:
        for peer in p.machine.peers.values():
            if len(peer.vectors) > KEPT or len(peer.account.rounds) > 3:
                yield f"{p.agent} keeps more than it needs"


def failing(schedule: Schedule, machine: type[Machine] = Machine) -> list[str]:
    """What does not hold in a schedule."""
    return broken(play(schedule, machine))


def shortest(schedule: Schedule, fails: Callable[[Schedule], bool]) -> Schedule:
    """The schedule with as few faults as still fail."""
    index = 0
    while index < len(schedule.faults):
        fewer = schedule.without(index)
        if fails(fewer):
            schedule = fewer
        else:
            index += 1
    return schedule
