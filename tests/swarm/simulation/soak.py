"""Many schedules, a part of them at a time in one process of several."""

from tests.swarm.simulation.invariants import failing, shortest
from tests.swarm.simulation.schedule import draw

PART = 50  # schedules that a worker plays at a time


def report(seed: int) -> str:
    """Nothing, or the shortest schedule that fails and how."""
    schedule = draw(seed)
    if not failing(schedule):
        return ""
    least = shortest(schedule, lambda fewer: bool(failing(fewer)))
    return "\n".join([str(least), *(f"  => {line}" for line in failing(least)[:5])])


def reports(first: int) -> list[str]:
    """Of a part of all seeds."""
    return [told for seed in range(first, first + PART) if (told := report(seed))]
