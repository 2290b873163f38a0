"""Thousands of schedules of faults, each to the bit the same whenever it is played."""

import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

from swarm.mixing.rules import EXACT, RuleName
from swarm.mixing.weights import neighbours
from tests.swarm.simulation.invariants import play
from tests.swarm.simulation.schedule import Damage, Fault, Schedule, draw
from tests.swarm.simulation.soak import PART, reports
from tests.swarm.simulation.world import World

SCHEDULES = int(os.environ.get("SCHEDULES", "2000"))  # `make soak SCHEDULES=100000`
FIRST = int(os.environ.get("FIRST_SEED", "0"))


@pytest.mark.timeout(0)
def test_no_schedule_breaks_an_invariant() -> None:
    parts = range(FIRST, FIRST + SCHEDULES, PART)
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as workers:
        wrong = [told for part in workers.map(reports, parts) for told in part]
    assert not wrong, f"{len(wrong)} of {SCHEDULES} schedules fail:\n\n" + "\n\n".join(wrong[:10])


def test_a_seed_gives_the_same_play_to_the_bit() -> None:
    for seed in (3, 11, 47):
        first, second = play(draw(seed)), play(draw(seed))
        for p, q in zip(first.processes, second.processes, strict=True):
            assert p.rounds == q.rounds
            assert p.said == q.said
            np.testing.assert_array_equal(p.theta, q.theta)


def test_without_faults_every_round_uses_every_edge() -> None:
    for seed in range(400):
        schedule = replace(draw(seed), faults=())
        world = World(schedule)
        world.run(8.0)
        for process in world.processes:
            assert len(process.rounds) > 8, schedule
            nearby = neighbours(world.topology, world.members, process.agent)
            for _, round_, used, _ in process.rounds:
                assert used == nearby, f"{schedule}: {process.agent} in round {round_}"
            assert not process.said, schedule


CHURN: tuple[Fault, ...] = (
    Fault("crash", 1, 4.0, 1.0, disk="kept"),
    Fault("cut", 2, 6.0, 2.5, other=-1),
    Fault("crash", 0, 10.0, 2.0, disk="lost"),
    Fault("lossy", 0, 13.0, 2.0),
    Fault("late", 4, 0.0),
    Fault("freeze", 3, 16.0, 2.5),
    Fault("leave", 2, 20.0),
    Fault("twin", 0, 22.0, disk="old"),
    Fault("crash", 3, 24.0, 0.5, disk="torn"),
)


@pytest.mark.parametrize("rule", EXACT)
def test_exact_rules_find_the_optimum_of_those_who_are_left(rule: RuleName) -> None:
    schedule = Schedule(7, 6, "ring", rule, 0.001, 0.0, 0.0, 0.0, CHURN)
    world = World(schedule)
    world.run(schedule.calm_from + 250.0)
    current = {m: p for m in world.members if (p := world.current(m)) is not None}
    assert set(current) == set(world.members) - {"a02"}
    best = np.mean([world.centres[member] for member in current], axis=0)
    for process in current.values():
        np.testing.assert_allclose(process.theta, best, atol=1e-9)


@pytest.mark.parametrize(
    "kind", ["crash", "freeze", "cut", "lossy", "twin", "leave", "late", "lie"]
)
def test_the_schedules_have_every_fault(kind: Damage) -> None:
    assert sum(any(f.kind == kind for f in draw(seed).faults) for seed in range(2000)) > 100
    assert {draw(seed).agents for seed in range(2000)} == set(range(2, 17))
