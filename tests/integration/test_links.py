"""Vectors of 5.12 MB over a link that is slow and far: real Zenoh, a proxy that shapes."""

import pytest

from deploy.chaos.shaping import Shape
from tests.bench.links import C3F2, measure

pytestmark = pytest.mark.integration


def test_every_round_is_mixed_and_nothing_is_sent_twice_for_being_slow() -> None:
    found = measure(2, C3F2, Shape(rate=20e6, latency=0.02), rounds=3)
    due, mixed = found.mixed
    assert mixed == due
    for report in found.reports:
        assert (report.resent, report.resumes, report.undelivered) == (0, 0, 0)
