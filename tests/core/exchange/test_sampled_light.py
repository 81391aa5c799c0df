"""Edges of a sampled light signal lie where it crosses the threshold, not at the sample after."""

from __future__ import annotations

import numpy as np
import pytest

from draglag.exchange.importers.columns import laser_of

PERIOD_S = 0.02  # 50 Hz
# A signal of straight lines between samples: up through 1.5 at a quarter, down at three quarters of an interval.
VOLT = np.array([0.0, 0.0, 1.2, 2.4, 3.0, 3.0, 1.0, 0.2, 0.2])
T_S = 7.0 + PERIOD_S * np.arange(VOLT.size)
CROSSINGS_S = [7.0 + PERIOD_S * 2.25, 7.0 + PERIOD_S * 5.75]


@pytest.mark.parametrize(("unit", "levels"), [(">1.5", [1, 0]), ("<1.5", [0, 1])])
def test_a_crossing_lies_on_the_line_between_two_samples(unit: str, levels: list[int]) -> None:
    laser = laser_of(T_S, VOLT, "s", unit, "a table")
    np.testing.assert_allclose(laser.t_s, CROSSINGS_S, rtol=0, atol=1e-12)
    assert laser.light.tolist() == levels


def test_latencies_of_a_signal_sampled_at_50_hz_have_no_bias() -> None:
    true_s = np.sort(np.random.default_rng(1).uniform(0.1, 59.9, 100))
    true_s = true_s[np.append(True, np.diff(true_s) > 4 * PERIOD_S)]
    t_s = np.arange(0.0, 60.0, PERIOD_S)
    # A beam that fades within one interval, as the area that the stylus covers does.
    rise = np.where(np.arange(true_s.size) % 2, -1.0, 1.0)
    volt = sum(sign * np.clip(0.5 + (t_s - at_s) / PERIOD_S, 0, 1) for sign, at_s in zip(rise, true_s, strict=True))
    laser = laser_of(t_s, np.asarray(volt), "s", ">0.5", "a table")
    assert len(laser.t_s) == len(true_s)
    error_s = laser.t_s - true_s
    # A crossing u < 1/2 of an interval after a sample is found at u / (1/2 + u): 0.086 off at most, early and late.
    assert np.abs(error_s).max() < 0.087 * PERIOD_S
    assert abs(error_s.mean()) < 3 * 0.087 * PERIOD_S / np.sqrt(len(true_s))


def test_in_a_table_of_changes_the_stamp_is_the_edge() -> None:
    t_s = np.array([1.0, 1.01, 3.0, 3.2, 7.0, 7.5])
    laser = laser_of(t_s, np.array([0.1, 3.1, 0.1, 3.1, 0.1, 3.1]), "s", ">1.5", "a table")
    np.testing.assert_array_equal(laser.t_s, t_s[1:])
    assert laser.light.tolist() == [1, 0, 1, 0, 1]


def test_after_a_hole_the_crossing_is_within_one_usual_interval() -> None:
    number = np.array([0, 1, 2, 3, 4, 30, 31])  # samples 5 to 29, of the same level, are not written
    laser = laser_of(PERIOD_S * number, np.where(number < 30, 0.0, 3.0), "s", ">1.5", "a table")
    np.testing.assert_allclose(laser.t_s, [PERIOD_S * 29.5], rtol=0, atol=1e-12)


def test_a_sample_without_a_number_is_no_edge() -> None:
    volt = VOLT.copy()
    volt[4] = np.nan
    laser = laser_of(T_S, volt, "s", ">1.5", "a table")
    np.testing.assert_allclose(laser.t_s, CROSSINGS_S, rtol=0, atol=1e-12)
