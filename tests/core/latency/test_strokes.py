"""Strokes back and forth with a rest at each turn: their path is no ellipse."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from bench.rigs import circle_run, rig_with_latency
from draglag.latency import estimate_run
from draglag.latency.steady import has_constant_speed, keeps_speed
from draglag.recording import Run
from draglag.simulation import Rig, RunTruth, rig_for_screen, simulate_run_with_truth
from draglag.simulation.kinematics import GRID_HZ, Motion

PEAKS_MM_S = (120.0, 250.0, 450.0)
WAY_MM, REST_S, STROKES = 120.0, 0.25, 40
OFF_MIDDLE = 0.1  # of the way
LARGEST_RMS = 1.66  # of twelve standard normal numbers: one set in a thousand has a larger one


def stroked(rig: Rig, peak_mm_s: float, seed: int) -> tuple[Run, RunTruth]:
    """Strokes of least jerk (Flash and Hogan 1985) across the beam, off their middle, along the panel."""
    stroke_s = 1.875 * WAY_MM / peak_mm_s
    cycle_s = stroke_s + REST_S
    t_s = np.arange(0.0, STROKES * cycle_s, 1 / GRID_HZ)
    count = np.floor(t_s / cycle_s)
    u = np.clip((t_s - count * cycle_s) / stroke_s, 0.0, 1.0)
    way = np.where(count % 2, -1.0, 1.0)
    along_mm_s = 0.4 * rig.screen.width_mm / t_s[-1]
    x_mm = 0.3 * rig.screen.width_mm + along_mm_s * t_s
    middle_mm = rig.beam.slope * x_mm + rig.beam.intercept_mm + OFF_MIDDLE * WAY_MM
    y_mm = middle_mm + way * WAY_MM * (u**3 * (10 - 15 * u + 6 * u**2) - 0.5)
    vy_mm_s = rig.beam.slope * along_mm_s + way * WAY_MM / stroke_s * 30 * (u * (1 - u)) ** 2
    motion = Motion(t_s, x_mm, y_mm, np.full(t_s.size, along_mm_s), vy_mm_s, np.ones(t_s.size, bool))
    rng = np.random.default_rng([seed, round(peak_mm_s)])
    return simulate_run_with_truth(rig, motion, run_id=f"stroke-{peak_mm_s:.0f}", planned=None, start_s=3.0, rng=rng)


@pytest.mark.parametrize("rig", [rig_with_latency(0.06), rig_for_screen("screen-1")], ids=["constant", "falling"])
def test_latency_and_width_of_strokes_lie_in_their_intervals(rig: Rig) -> None:
    rig = replace(rig, run_latency_sd_s=0.0, sensor_response_s=0.0)
    late, wide = [], []
    for peak_mm_s, seed in product(PEAKS_MM_S, range(4)):
        run, truth = stroked(rig, peak_mm_s, seed)
        found = estimate_run(run, rig.stylus.diameter_mm)
        numbers = (found.latency_s, found.latency_se_s, found.stylus_diameter_mm, found.stylus_diameter_se_mm)
        latency_s, latency_se_s, width_mm, width_se_mm = np.asarray(numbers, float)
        late.append((latency_s - truth.mean_latency_s) / latency_se_s)
        wide.append((width_mm - rig.stylus.diameter_mm) / width_se_mm)
    for z in (late, wide):
        assert np.sqrt(np.mean(np.square(z))) < LARGEST_RMS


def test_strokes_have_one_speed_at_the_beam_alone() -> None:
    run, _ = stroked(rig_for_screen("screen-1"), 250.0, 0)
    assert has_constant_speed(run)
    assert not keeps_speed(run)


def test_a_circle_without_its_name_keeps_its_speed() -> None:
    assert keeps_speed(replace(circle_run(250.0, 1)[0], protocol="free"))
