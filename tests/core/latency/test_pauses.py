"""Edges in pauses of the hand count in a run's mean latency, however few they are."""

from typing import Any

import numpy as np
import pytest

from draglag.latency import efficient, pauses
from draglag.latency.run import estimate_run
from draglag.recording import LaserTrace, Run, TouchTrace


def circles_with_pauses(at_s: tuple[float, ...]) -> tuple[Run, float]:
    """Circles of 44 mm at 190 mm/s across a beam, by a hand with near stops, on a screen whose latency falls with
    speed; and the mean latency over all edges."""
    rng = np.random.default_rng(5)
    radius_mm, speed_mm_s, duration_s, step_s = 22.0, 190.0, 25.0, 2.5e-4
    t_s = np.arange(-1.0, duration_s + 0.5, step_s)
    rate = np.ones(t_s.size)
    for centre_s in at_s:
        rate *= 1 - 0.85 * np.clip((0.18 - np.abs(t_s - centre_s)) / 0.1, 0, 1)
    angle = np.cumsum(rate) * step_s * speed_mm_s / radius_mm
    x_mm, y_mm = 150 + 4 * t_s + radius_mm * np.cos(angle), 130 + radius_mm * np.sin(angle)
    shown_s = t_s + 0.025 + 0.1 * (np.maximum(rate * speed_mm_s, 15.0) / 45.0) ** -0.8
    scan_s = np.arange(0.05, duration_s, 1 / 133)
    x, y = (np.interp(scan_s, shown_s, q) + 0.03 * rng.normal(size=scan_s.size) for q in (x_mm, y_mm))
    lit_mm = np.abs(y_mm - 130) - 3.5
    k = np.flatnonzero(np.diff(np.sign(lit_mm)) != 0)
    k = k[(t_s[k] > 0.2) & (t_s[k] < duration_s - 0.3)]
    edge_s = t_s[k] + step_s * lit_mm[k] / (lit_mm[k] - lit_mm[k + 1])
    run = Run(
        "run-01",
        "circle",
        0.0,
        duration_s,
        TouchTrace(scan_s, x, y),
        LaserTrace(edge_s, (lit_mm[k + 1] > 0).astype(np.int64)),
        nominal_speed_mm_s=speed_mm_s,
        radius_mm=radius_mm,
    )
    return run, float(np.mean(np.interp(edge_s, t_s, shown_s) - edge_s))


@pytest.mark.parametrize("at_s", [(), (8.6,), (8.9,), (9.3,)])
def test_the_mean_holds_the_edges_in_pauses(at_s: tuple[float, ...]) -> None:
    run, truth_s = circles_with_pauses(at_s)
    found = estimate_run(run, 7.0)
    assert found.latency_s is not None
    assert found.latency_s == pytest.approx(truth_s, abs=2.5e-4)


def test_a_slow_edge_that_the_trace_does_not_show_is_none_of_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """At its own, longer latency it would move the latency of the others by milliseconds."""
    run, _ = circles_with_pauses((9.3,))
    whole = estimate_run(run, 7.0)
    shown, searched_s, left = pauses._shown, [], []

    def all_but_the_first(t_s: Any, off_mm: Any, half_mm: float, edge_s: float, *more: Any) -> Any:
        searched_s.append(edge_s)
        return None if edge_s == searched_s[0] else shown(t_s, off_mm, half_mm, edge_s, *more)

    def seen(*given: Any) -> Any:
        left.append(pauses.without_pauses(*given))
        return left[-1]

    monkeypatch.setattr(pauses, "_shown", all_but_the_first)
    monkeypatch.setattr(efficient, "without_pauses", seen)
    found = estimate_run(run, 7.0)
    assert len(searched_s) >= 2
    ((others, _),) = left
    assert not np.isin(searched_s, others.edges.t_s).any()
    assert found.n_rejected == whole.n_rejected + 1


def strokes_with_one_turn_at_the_beam() -> Run:
    """Strokes of 28 mm back and forth, four a second, 25 ms late; one turns 0.5 mm beyond the beam's upper rim, which
    the trace does not reach."""
    rng = np.random.default_rng(7)
    t_s = np.arange(0.0, 12.0, 1e-4)
    short = (t_s > 6.0) & (t_s < 6.125)
    y_mm = 130 + np.where(short, 3.0, 28.0) * np.sin(2 * np.pi * 4 * t_s)
    scan_s = np.arange(0.1, 11.9, 0.005)
    x, y = (np.interp(scan_s - 0.025, t_s, q) + 0.03 * rng.normal(size=scan_s.size) for q in (150 + 15 * t_s, y_mm))
    y = np.where(np.abs(scan_s - 6.0875) < 0.0625, np.minimum(y, 132.3), y)
    lit_mm = np.abs(y_mm - 130) - 2.5
    k = np.flatnonzero(np.diff(np.sign(lit_mm)) != 0)
    k = k[(t_s[k] > 0.2) & (t_s[k] < 11.7)]
    light = (lit_mm[k + 1] > 0).astype(np.int64)
    return Run("run-01", "free", 0.0, 12.0, TouchTrace(scan_s, x, y), LaserTrace(t_s[k], light))


def test_a_slow_edge_is_not_looked_for_beyond_the_next_ones() -> None:
    """Of 192 edges two, 0.15 s off, would move the mean by more than a millisecond."""
    found = estimate_run(strokes_with_one_turn_at_the_beam(), 5.0)
    assert found.latency_s == pytest.approx(0.025, abs=3e-4)
    assert found.n_rejected == 2
