"""Strokes back and forth with a rest at each turn: their path is no ellipse."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from bench.rigs import circle_run, rig_with_latency
from bench.strokes import even_strokes
from draglag.latency import estimate_run
from draglag.latency.conduct import excluded_because, with_conduct
from draglag.latency.steady import SPREAD, has_constant_speed, keeps_speed, spread_in_trace
from draglag.recording import Run
from draglag.simulation import LatencyLaw, Rig, RunTruth, rig_for_screen, simulate_run_with_truth
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


def spread(truth: RunTruth) -> float:
    return float(truth.speed_mm_s.std() / truth.speed_mm_s.mean())


@pytest.mark.parametrize(
    ("rig", "speed_mm_s", "way_mm", "off_middle"),
    [
        (rig_for_screen("screen-1"), 600.0, 80.0, 0.15),
        (rig_with_latency(0.12), 450.0, 60.0, 0.0),
        (rig_with_latency(0.12), 700.0, 60.0, 0.0),
    ],
    ids=["near turns", "late", "late and near turns"],
)
def test_strokes_that_cross_evenly_between_near_turns_have_one_latency(
    rig: Rig, speed_mm_s: float, way_mm: float, off_middle: float
) -> None:
    """86 to 133 ms a stroke: a window of 0.2 s sees turns, and so does the trace 60 ms after the edge."""
    rig = replace(rig, run_latency_sd_s=0.0)
    run, truth = even_strokes(rig, speed_mm_s, way_mm, turn_s=0.05, off_middle=off_middle)
    assert spread(truth) < 0.001
    assert spread_in_trace(run) > SPREAD
    assert has_constant_speed(run)
    found = with_conduct(estimate_run(run, rig.stylus.diameter_mm), run)
    assert excluded_because(found) == ""
    assert found.latency_s == pytest.approx(truth.mean_latency_s, abs=3 * (found.latency_se_s or 0.0))


@pytest.mark.parametrize(
    ("speeds", "along"),
    [((1.0, 0.5), (0.0,)), ((1.0,), (0.0, 1.5, 0.0, -1.5))],
    ids=["across the beam", "along it"],
)
@pytest.mark.parametrize("way_mm", [60.0, 120.0])
def test_strokes_of_two_speeds_have_no_latency_of_their_own(
    way_mm: float, speeds: tuple[float, ...], along: tuple[float, ...]
) -> None:
    rig = rig_for_screen("screen-1")
    run, truth = even_strokes(rig, 250.0, way_mm, speeds=speeds, along=along, off_middle=0.3 if len(speeds) > 1 else 0)
    assert spread(truth) > SPREAD
    assert not has_constant_speed(run)


def test_even_strokes_whose_trace_leaps_past_the_edges_are_left_out() -> None:
    """A steep law holds the trace up where the stylus turns: it leaps through the beam."""
    rig = replace(rig_for_screen("screen-1"), law=LatencyLaw(300.0, 0.01, 0.0, 0.03, 40.0), run_latency_sd_s=0.0)
    run, truth = even_strokes(rig, 450.0, 90.0, turn_s=0.15, off_middle=0.2)
    assert spread(truth) < 0.03
    assert has_constant_speed(run)
    found = estimate_run(run, rig.stylus.diameter_mm)
    assert found.latency_s is not None
    assert found.latency_s > truth.mean_latency_s + 0.002
    assert excluded_because(with_conduct(found, run)) == "uneven trace"


def test_a_trace_of_one_point_changes_no_speed() -> None:
    run, _ = even_strokes(rig_for_screen("screen-1"), 300.0, 120.0)
    still = replace(run.touch, x_mm=np.full(run.touch.t_s.size, 100.1), y_mm=np.full(run.touch.t_s.size, 90.3))
    assert spread_in_trace(replace(run, touch=still)) == 0
