from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from draglag.errors import DataError
from draglag.instruments.clocks import (
    PAPER_DRIFT,
    clock_warnings,
    fit_clock,
    fit_clocks,
    latency_uncertainty_s,
    remapped,
)
from draglag.recording import ClockBounds, LaserTrace, Run, empty_touch


def exchanges(rng, offset_s, drift, at_s, trip_s, *, epoch=0, one_sided=False, stream="laser"):
    """Bounds of a clock with host = device · (1 + drift) + offset, seen over asymmetric round trips."""
    host = (1 + drift) * at_s + offset_s
    trip = rng.uniform(0.3, 1.0, len(at_s)) * trip_s
    low = host - trip * rng.uniform(0, 1, len(at_s))
    high = low + trip
    if one_sided:
        side = rng.integers(0, 3, len(at_s))  # 0: both, 1: only from below, 2: only from above
        side[:2] = (1, 2)
        low, high = np.where(side == 2, -np.inf, low), np.where(side == 1, np.inf, high)
    return ClockBounds(stream, at_s, low, high, np.full(len(at_s), epoch, np.int64))


@settings(deadline=None, max_examples=150)
@given(
    seed=st.integers(0, 2**32 - 1),
    offset_s=st.floats(-1e5, 1e5),
    ppm=st.floats(-200, 200),
    n=st.integers(2, 40),
    length_s=st.floats(0.1, 4000),
    trip_s=st.floats(2e-6, 5e-3),
    one_sided=st.booleans(),
)
def test_the_true_mapping_is_always_inside_the_bounds(seed, offset_s, ppm, n, length_s, trip_s, one_sided):
    rng = np.random.default_rng(seed)
    at_s = np.sort(rng.uniform(0, length_s, n)) + rng.uniform(0, 1e4)
    fit = fit_clock(exchanges(rng, offset_s, ppm * 1e-6, at_s, trip_s, one_sided=one_sided))
    clock = fit.epochs[0]
    assert clock.slack_s == 0
    assert clock.drift_interval[0] - 1e-9 <= ppm * 1e-6 <= clock.drift_interval[1] + 1e-9
    # Also between the exchanges and well outside them.
    asked = np.linspace(at_s[0] - length_s, at_s[-1] + length_s, 50)
    host, width = fit.map_to_host(asked)
    assert (np.abs(host - ((1 + ppm * 1e-6) * asked + offset_s)) <= width).all()


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), ppm=st.floats(-100, 100))
def test_every_epoch_has_an_offset_of_its_own(seed, ppm):
    rng = np.random.default_rng(seed)
    at_s = np.arange(0, 30.0)
    parts = [exchanges(rng, offset, ppm * 1e-6, at_s, 3e-4, epoch=k) for k, offset in enumerate((50.0, 117.3))]
    fit = fit_clock(parts)
    host, width = fit.map_to_host(np.array([10.0, 10.0]), np.array([0, 1]))
    assert (np.abs(host - np.array([60.0, 127.3]) - ppm * 1e-5) <= width).all()
    assert (width < 3e-4).all()
    with pytest.raises(DataError, match="epoch 2"):
        fit.map_to_host(np.array([10.0]), 2)


def test_more_exchanges_sharpen_offset_and_drift():
    rng = np.random.default_rng(3)
    few = fit_clock(exchanges(rng, 5.0, 12e-6, np.linspace(0, 60, 4), 4e-4)).epochs[0]
    many = fit_clock(exchanges(rng, 5.0, 12e-6, np.linspace(0, 600, 600), 4e-4)).epochs[0]
    assert many.fast_ppm == pytest.approx(-12, abs=0.5)
    assert np.ptp(many.drift_interval) < np.ptp(few.drift_interval) / 10
    assert many.to_host(np.array([300.0]))[1][0] < few.to_host(np.array([30.0]))[1][0]


def test_uncertainty_grows_away_from_the_comparisons():
    rng = np.random.default_rng(4)
    clock = fit_clock(exchanges(rng, 5.0, 0.0, np.linspace(0, 10, 20), 4e-4)).epochs[0]
    _, width = clock.to_host(np.array([5.0, 20.0, 60.0, 600.0]))
    assert (np.diff(width) > 0).all()


def test_contradicting_comparisons_are_widened_and_reported():
    at_s = np.linspace(0, 100, 101)
    wander = 2e-3 * np.sin(at_s / 8)  # no straight line does that
    host = at_s + 7 + wander
    fit = fit_clock(ClockBounds("walt", at_s, host - 1e-4, host + 1e-4))
    clock = fit.epochs[0]
    assert clock.slack_s == pytest.approx(1.9e-3, rel=0.1)
    mapped, width = fit.map_to_host(at_s)
    assert (np.abs(mapped - host) <= width).all()
    assert any("does not run evenly" in text for text in clock_warnings(fit))


def test_warnings_say_what_matters_and_only_that():
    rng = np.random.default_rng(5)
    at_s = np.linspace(0, 60, 61)
    assert clock_warnings(fit_clock(exchanges(rng, 0.0, 5e-6, at_s, 4e-4))) == []
    wide = clock_warnings(fit_clock(exchanges(rng, 0.0, 5e-6, at_s[[0, 60]], 8e-3)))
    assert len(wide) == 1
    assert "1 ms" in wide[0]
    # Host time that passes faster than the device counts it: the device's clock is slow.
    for drift, words in ((3 * PAPER_DRIFT, "ppm slow (3.00 ms in 60 s)"), (-3 * PAPER_DRIFT, "ppm fast (3.00 ms")):
        said = clock_warnings(fit_clock(exchanges(rng, 0.0, drift, at_s, 4e-4)))
        assert len(said) == 1
        assert words in said[0]


def test_bad_comparisons_are_refused():
    good = ClockBounds("laser", np.arange(3.0), np.arange(3.0), np.arange(3.0) + 1e-3)
    with pytest.raises(DataError, match="not numbers"):
        fit_clock(replace(good, device_s=np.array([0, np.nan, 2])))
    with pytest.raises(DataError, match="several devices"):
        fit_clock([good, replace(good, stream="walt")])
    with pytest.raises(DataError, match="different lengths"):
        fit_clock(replace(good, host_min_s=np.arange(2.0)))
    with pytest.raises(DataError):
        fit_clock([])
    unbounded = fit_clock(replace(good, host_max_s=np.full(3, np.inf)))
    assert unbounded.epochs == {}
    assert set(fit_clocks([good, replace(good, stream="walt")])) == {"laser", "walt"}


def a_run(device_s, sync=(), epoch=()):
    laser = LaserTrace(device_s * 0, np.tile([0, 1], len(device_s))[: len(device_s)], device_s, np.array(epoch, int))
    return Run("run-01", "circle", 0.0, 30.0, empty_touch(), laser, sync=tuple(sync))


def test_latency_uncertainty_of_a_run_and_remapping_with_hindsight():
    rng = np.random.default_rng(6)
    sync = exchanges(rng, 100.0, 15e-6, np.linspace(0, 30, 31), 4e-4)
    device_s = np.linspace(1, 29, 40)
    run = a_run(device_s, [sync])
    bound = latency_uncertainty_s(run)
    truth = device_s * (1 + 15e-6) + 100.0
    assert bound is not None
    assert 0 < bound < 2e-4
    assert np.abs(remapped(run).laser.t_s - truth).max() <= bound
    # Comparisons of the session do as well; without any the bound is unknown, without device stamps nil.
    assert latency_uncertainty_s(a_run(device_s), [sync]) == pytest.approx(bound)
    assert latency_uncertainty_s(a_run(device_s)) is None
    assert latency_uncertainty_s(a_run(device_s, [sync], np.ones(40))) is None
    assert latency_uncertainty_s(replace(run, laser=replace(run.laser, device_t_s=np.empty(0)))) == 0.0
    assert remapped(a_run(device_s)).laser.t_s is not None
