from __future__ import annotations

import numpy as np
import pytest

from draglag.instruments.beam import Lines, fit_lines, sides, stylus_diameter_mm


def test_sides_follow_kind_and_direction() -> None:
    falling = np.array([True, False, True, False])
    down = np.array([100.0, 100.0, -100.0, -100.0])
    assert sides(falling, down).tolist() == [-1, 1, 1, -1]


def test_eq_3_is_the_perpendicular_distance() -> None:
    slope, width = 0.3, 7.0
    lines = Lines(slope, slope, 10.0, 10.0 + width * np.hypot(1, slope))
    assert stylus_diameter_mm(lines, -50.0, 80.0) == pytest.approx(width)


def test_shared_slope_is_recovered_exactly() -> None:
    x = np.linspace(0, 100, 20)
    side = np.where(np.arange(20) % 2, 1.0, -1.0)
    y = 0.02 * x + 50 + 3.5 * side
    lines, residual = fit_lines(x, y, side, shared_slope=True)
    assert lines.slope_top == lines.slope_bottom == pytest.approx(0.02)
    assert lines.intercept_bottom_mm - lines.intercept_top_mm == pytest.approx(7.0)
    assert np.abs(residual).max() < 1e-9


def test_one_side_only_is_refused() -> None:
    with pytest.raises(ValueError, match="one side"):
        fit_lines(np.arange(4.0), np.arange(4.0), np.ones(4), shared_slope=True)
