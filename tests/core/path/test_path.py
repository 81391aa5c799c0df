"""The smoother under the efficient estimator, against paths that are known."""

from __future__ import annotations

import numpy as np
import pytest

from draglag.latency.path import Path, smooth_path
from draglag.latency.spectrum import corner_for_mean, corner_of, events_of, spectrum_of
from draglag.latency.track import independent_places
from draglag.latency.tremor import tremor_of
from draglag.recording import FloatArray

RATE_HZ, NOISE_MM = 120.0, 0.15
OMEGA = 2 * np.pi * 0.8


def circle(t_s: FloatArray) -> FloatArray:
    drift = np.column_stack([200 + 3 * t_s, np.full(t_s.size, 143.0)])
    return drift + 50 * np.column_stack([np.cos(OMEGA * t_s), np.sin(OMEGA * t_s)])


def stamps(seed: int, duration_s: float = 20.0) -> FloatArray:
    t_s = np.arange(0, duration_s, 1 / RATE_HZ)
    return t_s + 1e-4 * np.random.default_rng(seed).standard_normal(t_s.size)


def path_of(t_s: FloatArray, xy_mm: FloatArray) -> Path:
    events = events_of(t_s, xy_mm)
    return smooth_path(events, *corner_of(spectrum_of(events)))


def test_a_clean_circle_is_followed_to_a_few_micrometres_through_jitter_and_a_gap() -> None:
    t_s = stamps(1)
    t_s = t_s[(t_s < 9.0) | (t_s > 9.1)]
    noise = 1e-3 * np.random.default_rng(2).standard_normal((t_s.size, 2))
    path = path_of(t_s, circle(t_s) + noise)
    at_s = np.arange(0.02, 19.9, 0.013)
    assert np.abs(path.at(at_s) - circle(at_s)).max() < 0.01
    v_mm_s = np.gradient(circle(at_s), at_s, axis=0)[1:-1]
    assert np.abs(path.at(at_s, 1)[1:-1] - v_mm_s).max() < 0.5


@pytest.mark.parametrize("noise_mm", [1e-3, NOISE_MM])
@pytest.mark.parametrize("hole_s", [2.0, 7.0])
def test_a_hole_of_seconds_leaves_the_path_on_both_sides(noise_mm: float, hole_s: float) -> None:
    t_s = stamps(1, 40.0)
    noise = noise_mm * np.random.default_rng(2).standard_normal((t_s.size, 2))
    whole = path_of(t_s, circle(t_s) + noise)
    known = (t_s < 18.0) | (t_s > 18.0 + hole_s)
    path = path_of(t_s[known], (circle(t_s) + noise)[known])
    # At the ends of what was seen a path is known less well, and its covariance says so.
    at_s = np.concatenate([np.arange(1.5, 16.5, 0.1), np.arange(19.5 + hole_s, 38.5, 0.1)])
    errors = [np.sqrt(np.mean((each.at(at_s) - circle(at_s)) ** 2)) for each in (whole, path)]
    assert errors[1] < 2 * errors[0]  # fewer stretches show the spectrum, and so where its corner is
    assert np.isfinite(path.at(t_s)).all()


def test_a_point_far_from_the_origin_is_not_pulled_towards_it() -> None:
    t_s = stamps(1)
    noise = NOISE_MM * np.random.default_rng(2).standard_normal((t_s.size, 2))
    near, far = (path_of(t_s, circle(t_s) + noise + shift) for shift in (0.0, 1e4))
    at_s = np.arange(1.0, 19.0, 0.1)
    assert np.abs(far.at(at_s) - near.at(at_s) - 1e4).max() < 1e-3


def test_the_covariance_is_that_of_the_errors() -> None:
    at_s = np.array([0.02, 5.0, 5.05, 5.6, 12.0])
    errors, foretold = [], []
    for seed in range(150):
        t_s = stamps(seed)
        noise = NOISE_MM * np.random.default_rng([seed, 1]).standard_normal((t_s.size, 2))
        path = path_of(t_s, circle(t_s) + noise)
        errors.append((path.at(at_s) - circle(at_s)).T)
        scale = path.excess_error(at_s, t_s[[0, -1]])
        foretold.append(path.by_lag(np.abs(at_s[:, None] - at_s)) * scale[:, None] * scale)
    seen, reported = np.cov(np.concatenate(errors).T), np.mean(foretold, axis=0)
    # 300 values know a variance to 8 %. The end is far less certain than the middle.
    assert np.diag(seen)[1:] == pytest.approx(np.diag(reported)[1:], rel=0.35)
    assert seen[0, 0] == pytest.approx(reported[0, 0], rel=0.5)
    assert reported[0, 0] > 2 * reported[1, 1]
    assert seen[1, 2] / seen[1, 1] == pytest.approx(reported[1, 2] / reported[1, 1], abs=0.1)
    assert abs(reported[1, 4]) < 0.02 * reported[1, 1]


def test_tremor_is_seen_as_far_as_the_noise_allows() -> None:
    t_s = stamps(3, 40.0)
    rng = np.random.default_rng(4)
    f_hz = rng.uniform(8, 12, 60)
    phase = rng.uniform(0, 2 * np.pi, (60, 2))
    size = 0.1 * np.sqrt(2 / 60)

    def tremor(at_s: FloatArray) -> FloatArray:
        return size * np.sin(2 * np.pi * f_hz[:, None, None] * at_s[:, None] + phase[:, None, :]).sum(0)

    noise = NOISE_MM * rng.standard_normal((t_s.size, 2))
    events = events_of(t_s, circle(t_s) + tremor(t_s) + noise)
    path = smooth_path(events, *corner_of(spectrum_of(events)))
    found = tremor_of(events, path, path.at(t_s, 1))
    assert found is not None
    at_s = np.arange(1.0, 39.0, 0.007)
    error = float(np.var(found.at(at_s) - tremor(at_s)))
    whole = float(np.var(tremor(at_s)))
    assert error < 0.5 * whole
    assert error == pytest.approx(found.unobserved[0], rel=0.3)
    assert whole == pytest.approx(found.whole[0], rel=0.3)


def test_a_slow_stream_shows_no_tremor() -> None:
    t_s = np.arange(0, 20, 1 / 30)
    events = events_of(t_s, circle(t_s))
    path = smooth_path(events, *corner_of(spectrum_of(events)))
    assert tremor_of(events, path, path.at(t_s, 1)) is None


def test_edges_that_share_events_count_as_one_place() -> None:
    t_s = stamps(1)
    path = path_of(t_s, circle(t_s) + NOISE_MM * np.random.default_rng(2).standard_normal((t_s.size, 2)))
    apart_s = np.arange(1.0, 19.0, 3.1)
    pairs_s = np.sort(np.concatenate([apart_s, apart_s + 1e-3]))
    assert independent_places(path, apart_s) == pytest.approx(apart_s.size, rel=0.01)
    assert independent_places(path, pairs_s) == pytest.approx(apart_s.size, rel=0.01)


def test_a_mean_over_passes_keeps_a_harmonic_that_single_places_lose() -> None:
    """Its phase is the same at each of 64 passes, whose mean it shifts by more than their noise."""
    t_s = stamps(5, 40.0)
    harmonic = 0.04 * np.cos(4 * OMEGA * t_s)[:, None] * np.ones(2)
    noise = NOISE_MM * np.random.default_rng(6).standard_normal((t_s.size, 2))
    events = events_of(t_s, circle(t_s) + harmonic + noise)
    spectrum = spectrum_of(events)
    rhythm_hz, corner_hz, power = corner_of(spectrum)
    lost = []
    for places in (1.0, 64.0):
        path = smooth_path(events, rhythm_hz, corner_for_mean(spectrum, rhythm_hz, corner_hz, power, places), power)
        kept = path.like(harmonic).at(t_s[600:-600])
        lost.append(np.sqrt(np.mean((kept - harmonic[600:-600]) ** 2) / np.mean(harmonic**2)))
    assert lost[1] < 0.25 < lost[0]


def test_tremor_on_a_path_that_keeps_some_is_not_counted_twice() -> None:
    t_s = stamps(3, 40.0)
    tremor = 0.2 * np.sin(2 * np.pi * 9 * t_s)[:, None] * np.ones(2)
    noise = 0.05 * np.random.default_rng(4).standard_normal((t_s.size, 2))
    events = events_of(t_s, circle(t_s) + tremor + noise)
    rhythm_hz, _, power = corner_of(spectrum_of(events))
    low, high = (smooth_path(events, rhythm_hz, corner_hz, power) for corner_hz in (3.0, 9.0))
    found = tremor_of(events, low, low.at(t_s, 1), high)
    assert found is not None
    at_s = t_s[600:-600]
    error = high.at(at_s) + found.at(at_s) - circle(at_s) - tremor[600:-600]
    assert np.sqrt(np.mean(error**2)) < 0.05
