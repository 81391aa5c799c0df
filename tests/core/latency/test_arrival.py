"""Reports that a polled bus holds back: their lateness, and what it does to the latency of a run."""

import numpy as np
import pytest

from draglag.latency.arrival import lateness_s
from draglag.latency.run import estimate_run
from draglag.recording import LaserTrace, Run, TouchTrace

POLL_S = 0.008
LATENCY_S = 0.04


def polled(scan_s: np.ndarray, poll_s: float) -> np.ndarray:
    return np.ceil(scan_s / poll_s) * poll_s


@pytest.mark.parametrize("rate_hz", [90.0, 132.7])
def test_lateness_of_polled_reports_is_that_of_their_polls(rate_hz: float) -> None:
    """Some reports share a poll and its stamp, some polls bring none."""
    scan_s = np.arange(2000) / rate_hz
    stamp_s = polled(scan_s, POLL_S)
    put_off_s = stamp_s - scan_s
    assert lateness_s(stamp_s) == pytest.approx(put_off_s - put_off_s.mean(), abs=5e-5)


def test_a_lost_report_does_not_shift_the_lateness_of_those_that_follow() -> None:
    scan_s = np.delete(np.arange(2000) / 132.7, 500)
    stamp_s = polled(scan_s, POLL_S)
    off_s = lateness_s(stamp_s) - (stamp_s - scan_s)
    assert np.median(np.abs(off_s - np.median(off_s))) < 1e-4
    assert np.mean(np.abs(off_s - np.median(off_s)) < 3e-4) > 0.95


def test_an_even_stream_is_never_late() -> None:
    assert np.abs(lateness_s(np.arange(1000) / 120.0)).max() < 1e-9


def circles(late: bool) -> tuple[Run, float]:
    """Circles of 100 mm across a beam at 500 mm/s, and the mean latency over the edges. Stamps scatter by polls of 8
    ms: through late reports, or equally uneven scans."""
    rng = np.random.default_rng(3)
    radius_mm, speed_mm_s, duration_s = 50.0, 500.0, 20.0
    fine_s = np.arange(-0.5, duration_s + 0.5, 1e-4)
    angle = speed_mm_s / radius_mm * fine_s
    x_mm, y_mm = 150 + 4 * fine_s + radius_mm * np.cos(angle), 130 + radius_mm * np.sin(angle)
    lit_mm = np.abs(y_mm - 130) - 3.5
    k = np.flatnonzero(np.diff(np.sign(lit_mm)) != 0)
    k = k[(fine_s[k] > 0.2) & (fine_s[k] < duration_s - 0.3)]
    edge_s = fine_s[k] + 1e-4 * lit_mm[k] / (lit_mm[k] - lit_mm[k + 1])
    scan_s = np.arange(0.05, duration_s, 1 / 132.7)
    stamp_s = np.round(np.maximum.accumulate(polled(scan_s, POLL_S) + rng.exponential(4e-5, scan_s.size)), 6)
    seen_s = (scan_s if late else stamp_s) - LATENCY_S
    x, y = (np.interp(seen_s, fine_s, q) + 0.05 * rng.normal(size=scan_s.size) for q in (x_mm, y_mm))
    run = Run(
        "run-01",
        "circle",
        0.0,
        duration_s,
        TouchTrace(stamp_s, x, y),
        LaserTrace(edge_s, (lit_mm[k + 1] > 0).astype(np.int64)),
        nominal_speed_mm_s=speed_mm_s,
        radius_mm=radius_mm,
    )
    shown_s = edge_s + LATENCY_S
    put_off_s = np.interp(shown_s, scan_s, stamp_s - scan_s) if late else np.zeros(k.size)
    return run, float(np.mean(LATENCY_S + put_off_s))


@pytest.mark.parametrize("late", [True, False])
def test_the_mean_over_the_edges_holds_the_polls_they_met_and_no_others(late: bool) -> None:
    run, truth_s = circles(late)
    found = estimate_run(run, 7.0)
    assert found.latency_s is not None
    assert found.latency_se_s is not None
    assert found.latency_s == pytest.approx(truth_s, abs=5e-5)
    assert found.latency_se_s < 5e-5
