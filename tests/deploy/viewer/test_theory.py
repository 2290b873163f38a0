"""The bound of Lemma 2 stands beside the measured error, unless it would dwarf it."""

import msgspec
import pytest

from deploy.viewer.moments import Moment
from deploy.viewer.theory import BOUND, DECAY, Theory
from swarm.reports.telemetry import RoundReport
from tests.deploy.observe.crowds import crowd, reports


def drawn(told: list[RoundReport], size: int) -> dict[str, float]:
    return {row.path: row.value for row in Theory.of(crowd(size)).rows(Moment.of(told))}


def test_a_bound_that_is_near_is_drawn() -> None:
    found = drawn(reports(crowd(4)), 4)
    step = crowd(4).optimizer.step
    assert found[BOUND] == pytest.approx(step * 2.0 / 0.5)  # four norms of 1; the ring's gap
    assert found[DECAY] > 0


def test_one_that_would_press_the_lines_flat_is_not() -> None:
    told = [msgspec.structs.replace(r, gradient_norm=100.0) for r in reports(crowd(64))]
    found = drawn(told, 64)
    assert BOUND not in found
    assert DECAY in found
