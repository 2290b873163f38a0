"""The hand-made pilots order as expected, and the sheet can be drawn."""

import json
from pathlib import Path

import numpy as np
import pytest

from deploy.flying import measure, pilots
from deploy.flying import sheet as worlds


def test_pilots_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "MAX_STEPS", 150)
    msf = [
        measure.measure_in("indoor-pyramid", pilot, 8, 0).msf
        for pilot in ("random", "straight", "greedy")
    ]
    assert msf[0] < msf[1] < msf[2]
    assert msf[2] > 50


def test_same_seed_same_distance_and_it_is_told_how_far_it_is() -> None:
    told: list[tuple[int, float]] = []
    again = measure.measure_in("indoor-pyramid", "random", 5, 3)
    first = measure.measure_in("indoor-pyramid", "random", 5, 3, lambda *far: told.append(far))
    assert first == again
    assert told == sorted(told) and told[0][1] > 0 and told[-1] == (5, 1.0)


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    measure.measure_pilot("straight", ["indoor-pyramid"], flights=3, seed=1, as_json=True)
    (row,) = json.loads(capsys.readouterr().out)
    assert row["scene"] == "indoor-pyramid" and row["flights"] == 3 and row["msf"] > 0


def test_unknown_pilot() -> None:
    with pytest.raises(ValueError, match="expected greedy, straight or random"):
        pilots.make_pilot("ace", 0, 1)


def test_plan_avoids_a_wall() -> None:
    """A wall across the way at 3.2 m, open to the right: it turns right."""
    y = np.linspace(-3, 1.2, 80)
    wall = np.stack([np.full_like(y, 3.2), y], axis=1)
    assert pilots.plan(wall, 0.0, 0.0, 0.0) > 0
    assert pilots.plan(wall * [1, -1], 0.0, 0.0, 0.0) < 0
    assert pilots.plan(np.empty((0, 2)), 0.0, 0.0, 0.0) == 0


def test_sheet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = pytest.importorskip("PIL.Image")
    monkeypatch.setattr(worlds, "TILE", (108, 192))
    path = worlds.sheet(tmp_path / "sheet.png", ["indoor-pyramid"])
    picture = np.asarray(image.open(path))
    assert picture.shape == (2 * 108 + 18, 3 * 192 + 24, 3)
    assert picture.std() > 30
