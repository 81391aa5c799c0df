"""Steady circles off their centre fit the beam half a turn later, too: only the slow edges of start and stop do not."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from draglag.latency import estimate_run
from draglag.recording import LaserTrace, Run, TouchTrace

D_MM = 7.0
RAMP_S = 0.7
FINE_S = 2e-4


def circle_from_rest(speed_mm_s: float, latency_s: float, radius_mm: float, beam_mm: float) -> Run:
    """A robot's circle from rest to rest, shown later by a constant latency, across a beam off its centre."""
    rng = np.random.default_rng(round(speed_mm_s))
    fine_s = np.arange(0.0, 20.0, FINE_S)
    u = np.clip(np.minimum(fine_s, fine_s[-1] - fine_s) / RAMP_S, 0.0, 1.0)
    angle = np.cumsum(speed_mm_s / radius_mm * u**2 * (3 - 2 * u)) * FINE_S
    x_mm, y_mm = radius_mm * np.cos(angle) + 3.0 * fine_s, radius_mm * np.sin(angle)
    dark = np.abs(y_mm - beam_mm) < 0.5 * D_MM
    at = np.flatnonzero(np.diff(dark.astype(int)))
    t_s = np.arange(latency_s, 20.0, 0.007)
    shown = (np.interp(t_s - latency_s, fine_s, q) + rng.normal(0, 0.03, t_s.size) for q in (x_mm, y_mm))
    touch = TouchTrace(t_s, *shown, np.ones(t_s.size, np.int64))
    laser = LaserTrace(fine_s[at] + 0.5 * FINE_S, (~dark[at + 1]).astype(np.int64))
    return Run("run-01", "circle", 0.0, 20.0, touch, laser, speed_mm_s, radius_mm)


# Radius of the circle, and by how far the beam misses its centre.
SHAPES_MM = ((88.0, 25.0), (67.0, 19.0), (34.0, 8.0))
CASES = list(product((500.0, 600.0, 760.0, 820.0, 860.0, 920.0), (0.0336, 0.0493), SHAPES_MM))


@pytest.mark.parametrize(("speed_mm_s", "latency_s", "shape_mm"), CASES)
def test_the_slow_edges_of_start_and_stop_rule_it_out(
    speed_mm_s: float, latency_s: float, shape_mm: tuple[float, float]
) -> None:
    found = estimate_run(circle_from_rest(speed_mm_s, latency_s, *shape_mm), D_MM)
    assert found.latency_s == pytest.approx(latency_s, abs=1e-3)  # half a turn is 100 to 600 ms
