"""Steady circles off their centre fit the beam half a turn later, too: only the slow edges of start and stop do not."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from draglag.latency import RunEstimate, estimate_run
from draglag.latency.half_turns import decided_by_others
from draglag.recording import LaserTrace, Run, TouchTrace

D_MM = 7.0
RAMP_S = 0.7
FINE_S = 2e-4


def circle_from_rest(speed_mm_s: float, latency_s: float, radius_mm: float, beam_mm: float) -> Run:
    """A robot's circle from rest to rest, shown later by a constant latency, across a beam off its centre."""
    fine_s = np.arange(0.0, 20.0, FINE_S)
    ramp = np.clip(np.minimum(fine_s, fine_s[-1] - fine_s) / RAMP_S, 0.0, 1.0)
    return shown_late(fine_s, ramp, speed_mm_s, latency_s, radius_mm, beam_mm)


def shown_late(
    fine_s: np.ndarray,
    ramp: np.ndarray,
    speed_mm_s: float,
    latency_s: float,
    radius_mm: float,
    beam_mm: float,
    frame_s: float = 0.007,
    noise_mm: float = 0.03,
    width_mm: float = D_MM,
    seed: int | None = None,
) -> Run:
    """A circle that travels, at a speed that rises and falls smoothly with ``ramp`` (0 to 1)."""
    rng = np.random.default_rng(round(speed_mm_s) if seed is None else seed)
    angle = np.cumsum(speed_mm_s / radius_mm * ramp**2 * (3 - 2 * ramp)) * FINE_S
    x_mm, y_mm = radius_mm * np.cos(angle) + 3.0 * fine_s, radius_mm * np.sin(angle)
    dark = np.abs(y_mm - beam_mm) < 0.5 * width_mm
    at = np.flatnonzero(np.diff(dark.astype(int)))
    end_s = float(fine_s[-1] + FINE_S)
    t_s = np.arange(latency_s, end_s, frame_s)
    shown = (np.interp(t_s - latency_s, fine_s, q) + rng.normal(0, noise_mm, t_s.size) for q in (x_mm, y_mm))
    touch = TouchTrace(t_s, *shown, np.ones(t_s.size, np.int64))
    laser = LaserTrace(fine_s[at] + 0.5 * FINE_S, (~dark[at + 1]).astype(np.int64))
    return Run("run-01", "circle", 0.0, end_s, touch, laser, speed_mm_s, radius_mm)


# Radius of the circle, and by how far the beam misses its centre.
SHAPES_MM = ((88.0, 25.0), (67.0, 19.0), (34.0, 8.0))
CASES = list(product((500.0, 600.0, 760.0, 820.0, 860.0, 920.0), (0.0336, 0.0493), SHAPES_MM))


@pytest.mark.parametrize(("speed_mm_s", "latency_s", "shape_mm"), CASES)
def test_the_slow_edges_of_start_and_stop_rule_it_out(
    speed_mm_s: float, latency_s: float, shape_mm: tuple[float, float]
) -> None:
    found = estimate_run(circle_from_rest(speed_mm_s, latency_s, *shape_mm), D_MM)
    assert found.latency_s == pytest.approx(latency_s, abs=1e-3)  # half a turn is 100 to 600 ms


@pytest.mark.parametrize(("noise_mm", "length_s"), list(product((0.02, 0.05), (7.5, 10.0))))
def test_edges_that_smoothing_moves_in_a_start_rule_no_latency_out(noise_mm: float, length_s: float) -> None:
    """Four edges of a brisk start lie up to half a millimetre off the smoothed path, fewer half a turn later."""
    found = estimate_run(brisk_start(noise_mm, length_s), 10.0)
    assert found.latency_s is None or found.latency_s == pytest.approx(0.027, abs=1e-3)  # half a turn is 320 ms


def brisk_start(noise_mm: float, length_s: float) -> Run:
    """A robot's circle that has its speed after 0.3 s, shown 27 ms late."""
    fine_s = np.arange(0.0, length_s, FINE_S)
    ramp = np.clip(fine_s / 0.3, 0.0, 1.0)
    return shown_late(fine_s, ramp, 336.0, 0.027, 34.3, 2.8, 1 / 240, noise_mm, 10.0, seed=3)


def even_circle(speed_mm_s: float, latency_s: float, radius_mm: float = 56.0, beam_mm: float = 24.0) -> Run:
    """A circle that travels without any irregularity but touch noise: it fits a beam half a turn later as well."""
    turn_s, rng = 2 * np.pi * radius_mm / speed_mm_s, np.random.default_rng(2)
    t_s = np.arange(0.0, 30.0, 0.0075)
    angle = 2 * np.pi * (t_s - latency_s) / turn_s
    x_mm, y_mm = radius_mm * np.array([np.cos(angle), np.sin(angle)]) + rng.normal(0, 0.1, (2, t_s.size))
    x_mm += 3.0 * t_s
    # Where the stylus' upper or lower end reaches the beam, going down the screen and back.
    ends = np.arcsin((beam_mm + 0.5 * D_MM * np.array([-1, 1])) / radius_mm) / (2 * np.pi)
    once = np.concatenate([ends, 0.5 - ends[::-1]]) * turn_s
    edge_s = np.concatenate([once + k * turn_s for k in range(1, int(29 / turn_s))])
    light = np.tile([0, 1, 0, 1], edge_s.size // 4)
    touch = TouchTrace(t_s, x_mm, y_mm, np.ones(t_s.size, np.int64))
    return Run("run-01", "circle", 0.0, 30.0, touch, LaserTrace(edge_s, light), speed_mm_s, radius_mm)


def test_no_half_turn_is_taken_for_the_latency_because_of_where_the_grid_lies() -> None:
    """Between two points of the search's grid a fast stylus goes 3 mm."""
    for latency_s in np.arange(0.030, 0.0345, 5e-4):
        found = estimate_run(even_circle(780.0, float(latency_s)), D_MM, window_s=(-0.15, 0.45))
        assert found.latency_s is None or abs(found.latency_s - latency_s) < 1e-3


@pytest.mark.parametrize(("usual_s", "speed_mm_s", "decided"), [(0.04, 700.0, True), (0.04, 300.0, False)])
def test_runs_of_about_its_speed_decide_on_a_circle_that_fits_twice(
    usual_s: float, speed_mm_s: float, decided: bool
) -> None:
    run, latency_s = even_circle(780.0, 0.033), 0.033
    found = estimate_run(run, D_MM)
    assert found.latency_s is None
    assert "alias" in found.flags
    other = RunEstimate("run-02", "circle", speed_mm_s, "kernel", speed_mm_s=speed_mm_s, latency_s=usual_s)
    known, _ = decided_by_others(
        [run, run], [found, other], lambda run, window_s: estimate_run(run, D_MM, window_s=window_s)
    )
    assert known.latency_s == (pytest.approx(latency_s, abs=1e-3) if decided else None)
    assert "alias" in known.flags


@pytest.mark.parametrize(("others_s", "decided"), [((0.034, 0.032, 0.033), True), ((0.034, 0.268, 0.266), False)])
def test_most_runs_of_about_its_speed_correct_one_that_is_half_a_turn_off(
    others_s: tuple[float, ...], decided: bool
) -> None:
    """Half a turn of it is 226 ms: an estimate without a flag that lies as far from two of three others is an alias."""
    run = even_circle(780.0, 0.033)
    found = estimate_run(run, D_MM, window_s=(0.2, 0.35))
    assert found.latency_s == pytest.approx(0.033 + np.pi * 56.0 / 780.0, abs=1e-3)
    others = [
        RunEstimate(f"run-{k:02}", "circle", 780.0, "kernel", speed_mm_s=780.0 + k, latency_s=latency_s)
        for k, latency_s in enumerate(others_s, start=2)
    ]
    known, *_ = decided_by_others(
        [run] * 4, [found, *others], lambda run, window_s: estimate_run(run, D_MM, window_s=window_s)
    )
    assert ("alias" in known.flags) is decided
    assert known.latency_s == (pytest.approx(0.033, abs=1e-3) if decided else found.latency_s)
