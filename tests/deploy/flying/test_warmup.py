"""One process makes what several would make at the same time: each world once, no others."""

from typing import Any

import pytest

from agent.config.experiment import Task
from deploy.flying import warmup


def test_every_world_that_is_flown_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[tuple[dict[str, Any], bool]] = []
    monkeypatch.setattr(warmup, "_take_a_step", lambda *what: made.append(what))
    long, cloud = {"scene": "indoor-long"}, {"scene": "indoor-cloud", "body": "mavlink"}
    flown = [Task(warmup.FLIGHT, settings) for settings in (long, cloud, long)]
    warmup.warm_up([*flown, Task("sim:GridWorld-v0", {})])
    assert made == [(long, False), ({"scene": "indoor-cloud"}, True)]
