"""Steps as long as their rounds."""

from math import prod

import pytest

from swarm.pace import LEAD, LONGEST, START, Pace, left_behind


def test_everybody_climbs_as_far_in_the_same_time() -> None:
    durations = {"a": 0.1, "b": 0.1, "slow": 0.5, "c": 0.1}  # on a path
    names, paces = list(durations), {name: Pace() for name in durations}
    climbed, due = dict.fromkeys(names, 0.0), dict(durations)
    while (now := min(due.values())) < 100.0:
        name = min(due, key=lambda n: due[n])
        i = names.index(name)
        nearby = [paces[names[j]].usual for j in (i - 1, i + 1) if 0 <= j < len(names)]
        climbed[name] += paces[name].lap(now, nearby)
        due[name] += durations[name]
    usual = prod(durations.values()) ** (1 / len(durations))
    for pace in paces.values():
        assert pace.usual == pytest.approx(usual, rel=0.3)
    assert climbed == pytest.approx(dict.fromkeys(names, 100.0 / usual), rel=0.3)


def test_alone_or_among_equals_steps_are_as_ever() -> None:
    pace = Pace()
    for i in range(100):
        assert pace.lap(i * 0.1, [0.1, 0.1]) == pytest.approx(1.0)


def test_a_step_is_never_absurd() -> None:
    pace = Pace()
    pace.lap(0.0, [])
    assert pace.lap(1.0, [1e-9, 1e-9]) == LONGEST
    pace = Pace()
    pace.lap(0.0, [])
    assert pace.lap(1.0, [1e9, 1e9]) == 1 / LONGEST


def test_who_is_far_behind_is_waited_for() -> None:
    rounds = {"a": 100, "b": 0}
    assert left_behind(START, rounds) == set()
    assert left_behind(START + 1, rounds) == {"b"}
    assert left_behind(100 * LEAD + START + 1, rounds) == {"a", "b"}
