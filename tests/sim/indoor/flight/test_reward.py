"""The reward against hand numbers and against PEDRA's formula written out in NumPy."""

import numpy as np
import pytest

from sim.indoor.flight.reward import CRASH_THRESHOLD, FULL_SCALE, window, windowed


def by_the_book(depth: np.ndarray) -> float:
    """PEDRA's avg_depth, middle window."""
    d = np.minimum(depth.astype(np.float64), FULL_SCALE) / FULL_SCALE
    height, width = d.shape
    n = max(d.mean() * 50 / 3, 1)
    top = int(0.9 * height * (n - 1) / (2 * n))
    left = int(width * (n - 1) / (2 * n))
    part = d[top : int(np.round(top + height / n)), left : int(np.round(left + width / n))]
    return float(np.sort(part.ravel())[: max(int(np.round(0.05 * part.size)), 1)].mean())


def test_units() -> None:
    """50 of 255 units of 100 m; the threshold is 1.37 m."""
    assert pytest.approx(19.608, abs=1e-3) == FULL_SCALE
    assert pytest.approx(1.373, abs=1e-3) == CRASH_THRESHOLD * FULL_SCALE


def test_hand_numbers() -> None:
    # everything further than the cut: full reward, window of a sixteenth or so
    assert windowed(np.full((103, 103), 30.0, np.float32)) == pytest.approx(1.0)
    assert windowed(np.full((103, 103), np.inf, np.float32)) == pytest.approx(1.0)
    # a flat wall at a tenth of the scale
    assert windowed(np.full((103, 103), FULL_SCALE / 10, np.float32)) == pytest.approx(0.1)
    # n = 50 * 0.12 / 3 = 2: half the picture, rows int(0.9 * 103 / 4) = 23 to 74 (74.5 to even)
    assert window(0.12, 103, 103) == (23, 74, 25, 76)
    # as near as n = 1: the whole picture
    assert window(0.05, 103, 103) == (0, 103, 0, 103)


def test_only_the_window_counts_and_in_it_the_nearest_twentieth() -> None:
    depth = np.full((100, 100), 0.12 * FULL_SCALE, np.float32)
    depth[0, :] = 0.05  # above the window
    assert windowed(depth) == pytest.approx(0.12, rel=1e-3)
    depth = np.full((100, 100), 0.12 * FULL_SCALE, np.float32)
    depth[50, 40:60] = 0.5 * 0.12 * FULL_SCALE  # 20 of 2,500 pixels; the nearest 125 count
    mean = (20 * 0.06 + 105 * 0.12) / 125
    assert windowed(depth) == pytest.approx(mean, rel=5e-3)


@pytest.mark.statistical
def test_agrees_with_the_formula() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        depth = rng.gamma(2.0, rng.uniform(0.3, 6.0), (103, 103)).astype(np.float32)
        assert windowed(depth) == pytest.approx(by_the_book(depth), rel=1e-6)
