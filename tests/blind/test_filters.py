"""Each filter of a controller against what is known of it in closed form."""

import numpy as np
import pytest

from blind.physics.filters.deadband import backlash, deadband, fuzz, jump
from blind.physics.filters.euro import euro
from blind.physics.filters.low_pass import ABOVE_MM_S, WINDOWS, first_order, moving_average
from blind.physics.filters.prediction import predict
from blind.physics.filters.tracker import alpha_beta

T = np.arange(0, 8, 0.002)


def line(speed, angle=0.6):
    return speed * T * np.cos(angle), speed * T * np.sin(angle)


def lag_s(out, given, speed):
    """How far the last report is behind on a straight line, in time."""
    return float(np.hypot(given[0][-1] - out[0][-1], given[1][-1] - out[1][-1]) / speed)


@pytest.mark.parametrize("speed", [45.0, 200.0, 900.0])
def test_euro_lags_by_its_cutoff_at_constant_speed(speed):
    xy = line(speed)
    cutoff = 1.0 + 0.03 * speed
    assert lag_s(euro(T, xy, 1.0, 0.03), xy, speed) == pytest.approx(1 / (2 * np.pi * cutoff), rel=1e-3)


def test_euro_by_axis_lags_more_along_the_slower_axis():
    x, y = line(200.0, angle=0.3)
    out = euro(T, (x, y), 1.0, 0.03, per_axis=True)
    for given, got, speed in zip((x, y), out, (200 * np.cos(0.3), 200 * np.sin(0.3)), strict=True):
        lag = (given[-1] - got[-1]) / speed
        assert lag == pytest.approx(1 / (2 * np.pi * (1.0 + 0.03 * speed)), rel=1e-3)


def test_euro_is_late_to_see_a_change_of_speed():
    """Its speed is low-passed at 1 Hz: just after a start it lags as at a lower speed."""
    x = np.where(T < 4, 45 * T, 180 + 600 * (T - 4))
    out, _ = euro(T, (x, np.zeros_like(x)), 1.0, 0.03)
    shortly = np.searchsorted(T, 4.1)
    assert (x[shortly] - out[shortly]) / 600 > 1.5 / (2 * np.pi * (1 + 0.03 * 600))


@pytest.mark.parametrize("scan_s", [0.001, 0.002, 0.0167])
def test_prediction_leads_by_its_horizon(scan_s):
    t = np.arange(0, 2, scan_s)
    x, y = predict(t, (300 * t, -100 * t), 0.015)
    np.testing.assert_allclose(x[2:] - 300 * t[2:], 300 * 0.015, atol=1e-9)
    np.testing.assert_allclose(y[2:] + 100 * t[2:], -100 * 0.015, atol=1e-9)


def test_prediction_leaves_a_touch_that_stands_still():
    still = np.full_like(T, 7.0)
    x, _ = predict(T, (still, still), 0.02)
    np.testing.assert_array_equal(x, still)


def test_jump_holds_and_then_goes_all_the_way():
    x = 0.01 * np.arange(1000)
    out, _ = jump((x, np.zeros_like(x)), 0.295)
    moves = np.diff(out)
    assert set(np.round(moves[moves > 0], 6)) == {0.3}
    # a sawtooth: half of the jump behind, on average
    assert np.mean(x - out) == pytest.approx(0.145, abs=0.005)


def test_backlash_stays_its_play_behind_either_way():
    x = np.concatenate([np.linspace(0, 10, 500), np.linspace(10, 0, 500)])
    out = backlash(x, 0.2)
    assert out[499] == pytest.approx(9.8)
    assert out[-1] == pytest.approx(0.2)
    assert np.ptp(out[490:510]) == pytest.approx(0.18, abs=0.03)


def test_fuzz_has_the_kernels_three_zones():
    for step, goes in ((0.49, 0.0), (0.6, 0.15), (1.5, 0.75), (2.5, 2.5), (-1.5, -0.75)):
        assert fuzz(np.array([0.0, step]), 1.0)[1] == pytest.approx(goes)


def test_deadband_of_a_kind_moves_a_resting_touch_less_than_its_noise():
    rng = np.random.default_rng(1)
    rest = 0.05 * rng.normal(size=(2, 4000))
    for kind in ("jump", "backlash", "fuzz"):
        x, _ = deadband((rest[0], rest[1]), 0.3, kind)
        assert np.std(np.diff(x)) < 0.2 * np.std(np.diff(rest[0])), kind


def test_first_order_lags_by_its_time_constant_and_shrinks_circles():
    xy = line(120.0)
    assert lag_s(first_order(T, xy, 0.045), xy, 120.0) == pytest.approx(0.045, rel=1e-3)
    turning = 2 * np.pi * 1.5
    x, y = first_order(T, (np.cos(turning * T), np.sin(turning * T)), 0.045)
    radius = np.hypot(x, y)[len(T) // 2 :].mean()
    assert radius == pytest.approx(1 / np.hypot(1, turning * 0.045), rel=0.01)


@pytest.mark.parametrize(("speed", "share"), list(zip((40.0, 150.0, 600.0), WINDOWS, strict=True)))
def test_moving_average_lags_by_half_its_window(speed, share):
    assert np.searchsorted(ABOVE_MM_S, speed) == WINDOWS.index(share)
    xy = line(speed)
    assert lag_s(moving_average(T, xy, 0.16), xy, speed) == pytest.approx(share * 0.08, abs=0.0011)


def test_tracker_has_no_lag_at_constant_velocity_and_a_known_one_in_acceleration():
    xy = line(300.0)
    assert lag_s(alpha_beta(T, xy, 0.012), xy, 300.0) == pytest.approx(0.0, abs=1e-6)
    assert lag_s(alpha_beta(T, xy, 0.012, ahead_s=0.01), xy, 300.0) == pytest.approx(0.01, rel=1e-6)
    x = 0.5 * 900.0 * T**2
    out, _ = alpha_beta(T, (x, x), 0.012)
    alpha = 1 - np.exp(-0.002 / 0.012)
    assert x[-1] - out[-1] == pytest.approx(900 * 0.002**2 * (1 - alpha) * (2 - alpha) / alpha**2, rel=1e-3)


def test_filters_are_causal():
    """What comes later changes nothing of what was reported before."""
    rng = np.random.default_rng(2)
    xy = tuple(np.cumsum(rng.normal(size=(2, 1000)), axis=1))
    other = tuple(np.concatenate([q[:600], q[600:] + 50.0]) for q in xy)
    t = T[:1000]
    for run in (
        lambda q: euro(t, q, 1.0, 0.03),
        lambda q: first_order(t, q, 0.04),
        lambda q: moving_average(t, q, 0.16),
        lambda q: alpha_beta(t, q, 0.012),
        lambda q: predict(t, q, 0.015),
        lambda q: deadband(q, 0.3, "jump"),
        lambda q: deadband(q, 0.2, "backlash"),
        lambda q: deadband(q, 0.3, "fuzz"),
    ):
        np.testing.assert_allclose(run(xy)[0][:600], run(other)[0][:600], atol=1e-9)
