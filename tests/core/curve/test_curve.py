from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from draglag.analysis import analyze
from draglag.curve import CurvePoints, fit_best, fit_form
from draglag.curve.compare import curve_difference
from draglag.errors import EstimateError
from draglag.exchange import read_exchange
from draglag.simulation import LatencyLaw

SPEEDS = np.geomspace(44, 1000, 16)
TABLE_2 = [(90.53, 4e-3, 182.9, 2.9e-2, 28.49), (9.57, 3.3e-3, 440.7, 1.98e-2, 28.22)]


def points(law: tuple[float, ...], noise_s: float = 0.0, seed: int = 0) -> CurvePoints:
    latency = LatencyLaw(*law).latency_s(SPEEDS)
    latency = latency + noise_s * np.random.default_rng(seed).standard_normal(SPEEDS.size)
    return CurvePoints(SPEEDS, latency, np.full(SPEEDS.size, max(noise_s, 1e-6)))


@pytest.mark.parametrize("law", TABLE_2)
def test_table_2_is_recovered_from_clean_points(law: tuple[float, ...]) -> None:
    curve = fit_form(points(law), "double_exponential")
    found = [curve.parameters[n] for n in ("a1_ms", "a2_s_per_mm", "a4_ms", "a5_s_per_mm", "a7_ms")]
    assert found == pytest.approx(law, rel=5e-3)
    assert curve.rms_s < 1e-5


@settings(max_examples=15, deadline=None, derandomize=True)
@given(a1=st.floats(20, 150), a2=st.floats(2e-3, 6e-3), a4=st.floats(80, 400), a5=st.floats(1.5e-2, 4e-2))
def test_eq_5_predicts_what_it_was_given(a1: float, a2: float, a4: float, a5: float) -> None:
    law = (a1, a2, a4, a5, 28.0)
    curve = fit_form(points(law), "double_exponential")
    assert curve.predict_s(SPEEDS) == pytest.approx(LatencyLaw(*law).latency_s(SPEEDS), abs=3e-5)


def test_the_band_covers_the_truth() -> None:
    law = TABLE_2[0]
    inside = []
    for seed in range(60):
        curve = fit_form(points(law, 5e-4, seed), "double_exponential")
        low, high = curve.band_s(SPEEDS)
        truth = LatencyLaw(*law).latency_s(SPEEDS)
        inside.append(np.mean((low <= truth) & (truth <= high)))
    assert np.mean(inside) > 0.88  # 95 % pointwise; 60 correlated curves scatter it by a few percent


def test_correlations_are_those_of_repeated_measurements() -> None:
    fits = [fit_form(points(TABLE_2[0], 3e-4, seed), "double_exponential") for seed in range(100)]
    found = np.corrcoef([list(fit.parameters.values()) for fit in fits], rowvar=False)
    names = list(fits[0].parameters)
    stated = fits[0].correlations
    assert len(stated) == 10
    assert list(stated.values()) == sorted(stated.values(), key=lambda r: -abs(r))
    for (one, other), r in stated.items():
        # Fisher's transform of a correlation over n fits has a standard deviation of 1 / sqrt(n - 3).
        assert np.arctanh(found[names.index(one), names.index(other)]) == pytest.approx(np.arctanh(r), abs=0.45)


def test_a_coefficient_at_its_bound_is_shown_without_an_interval() -> None:
    flat = fit_form(CurvePoints(SPEEDS, np.full(16, 0.05), np.full(16, 1e-3)), "double_exponential")
    assert flat.parameters["a1_ms"] == 0
    assert flat.correlations == {}
    assert flat._repr_html_().count("<td>–</td>") == 4


def test_a_tied_asymptote_hands_its_own_error_on() -> None:
    """Refitted with taps off by one standard error, coefficients move as the covariance says."""
    exact = points(TABLE_2[1])
    tie_s, se_s = 0.02814, 2e-4
    plain = fit_form(exact, "double_exponential", tied_asymptote_s=tie_s)
    unsure = fit_form(exact, "double_exponential", tied_asymptote_s=tie_s, tied_se_s=se_s)
    off = [fit_form(exact, "double_exponential", tied_asymptote_s=tie_s + d) for d in (-se_s, se_s)]
    moved = 0.5 * (off[1].values - off[0].values)
    added = np.diag(unsure.covariance - plain.covariance)
    assert np.allclose(unsure.values, plain.values)
    assert unsure.standard_errors["a7_ms"] == pytest.approx(0.2)
    assert np.sqrt(added) == pytest.approx(np.abs(moved), rel=0.1)


def test_a_tied_asymptote_stays_tied() -> None:
    curve = fit_form(points(TABLE_2[1]), "double_exponential", tied_asymptote_s=0.02814)
    assert curve.parameters["a7_ms"] == pytest.approx(28.14)
    assert curve.standard_errors["a7_ms"] == 0


def test_simple_forms_win_where_they_are_true() -> None:
    flat = CurvePoints(SPEEDS, 0.05 + 2e-4 * np.random.default_rng(1).standard_normal(16), np.full(16, 2e-4))
    assert fit_best(flat).form in ("constant", "single_exponential", "adaptive_low_pass", "double_exponential")
    assert fit_best(flat).predict_s(np.array([300.0]))[0] == pytest.approx(0.05, abs=5e-4)
    assert fit_best(points(TABLE_2[0], 3e-4)).form == "double_exponential"


@pytest.mark.parametrize("exponent", [0.45, 0.8])
def test_a_power_of_the_speed_is_found_and_ends_where_it_ends(exponent: float) -> None:
    """Below its fastest runs it falls by another 10 ms, which no sum of exponentials follows."""
    power_s = [0.021 + 0.031 * (speed / 100) ** -exponent for speed in (SPEEDS, 1e5)]
    noisy = CurvePoints(SPEEDS, power_s[0] + 3e-4 * np.random.default_rng(2).standard_normal(16), np.full(16, 3e-4))
    curve = fit_best(noisy)
    assert curve.form == "power"
    assert curve.parameters["exponent"] == pytest.approx(exponent, abs=2 * curve.half_intervals["exponent"])
    low, high = curve.band_s(np.array([1e5]))
    assert low[0] < power_s[1] < high[0]
    assert np.isfinite(curve.predict_s(np.array([0.0]))).all()


def test_a_speed_error_counts_where_the_curve_is_steep() -> None:
    given_points = points(TABLE_2[0], 3e-4)
    wide = replace(given_points, speed_se_mm_s=np.full(SPEEDS.size, 3.0))
    low, high = fit_form(given_points, "double_exponential").band_s(np.array([50.0]))
    low2, high2 = fit_form(wide, "double_exponential").band_s(np.array([50.0]))
    assert (high2 - low2)[0] > 1.5 * (high - low)[0]


def test_too_few_points_are_refused() -> None:
    few = points(TABLE_2[0]).take(np.arange(16) < 3)
    with pytest.raises(EstimateError, match="cannot determine"):
        fit_form(few, "double_exponential")


@pytest.mark.parametrize("seed", range(5))
def test_five_runs_that_fall_are_no_constant_and_five_that_do_not_are_one(seed: int) -> None:
    """138 to 88 ms, known to 1 ms: AICc allows five runs no third parameter however far a constant misses."""
    speed = np.array([38.0, 57.0, 84.0, 107.0, 152.0])
    noise_s = 1e-3 * np.random.default_rng(seed).standard_normal(5)
    se_s = np.full(5, 1e-3)
    falling = CurvePoints(speed, 0.06 + 0.11 * np.exp(-speed / 110) + noise_s, se_s, np.zeros(5), np.zeros(5))
    found = fit_best(falling)
    assert found.form != "constant"
    assert found.rms_s < 3e-3
    assert fit_best(replace(falling, latency_s=0.1 + noise_s)).form == "constant"


def test_inside_marks_extrapolation() -> None:
    curve = fit_form(points(TABLE_2[0]), "double_exponential")
    assert curve.inside(np.array([10.0, 100.0, 2000.0])).tolist() == [False, True, False]


def test_curves_that_differ_are_distinguished_and_equal_ones_are_not() -> None:
    a, b = (fit_form(points(TABLE_2[0], 3e-4, seed), "double_exponential") for seed in (1, 2))
    c = fit_form(points(TABLE_2[1], 3e-4, 3), "double_exponential")
    same, other = curve_difference(a, b), curve_difference(a, c)
    assert same is not None
    assert other is not None
    assert same.p_value > 1e-3
    assert other.p_value < 1e-6


def test_runs_of_uneven_speed_do_not_bend_the_curve() -> None:
    law = LatencyLaw(*TABLE_2[0])
    rng = np.random.default_rng(5)
    spread = 0.2 * SPEEDS
    uneven = [v + s * rng.standard_normal(20000) for v, s in zip(SPEEDS, spread, strict=True)]
    shown = np.array([np.mean(law.latency_s(v)) for v in uneven])
    speed, sd = np.array([v.mean() for v in uneven]), np.array([v.std() for v in uneven])
    runs = CurvePoints(speed, shown, np.full(16, 1e-4), speed_sd_mm_s=sd)
    errors = [
        np.abs(fit_form(one, "double_exponential").predict_s(SPEEDS) - law.latency_s(SPEEDS)).max()
        for one in (runs, replace(runs, speed_sd_mm_s=None))
    ]
    assert errors[0] < 6e-4
    assert errors[1] > 2 * errors[0]


def test_an_exponential_that_hardly_any_run_can_see_has_an_open_interval() -> None:
    # 6 ms at the slowest run and nothing from the third on: its amplitude at rest is anybody's guess.
    law = (3000.0, 0.14, 310.0, 0.0187, 23.5)
    for seed in range(6):
        curve = fit_form(points(law, 3e-4, seed), "double_exponential")
        fast = max(("a1_ms", "a4_ms"), key=lambda name: curve.parameters[name])
        assert curve.standard_errors[fast] > 200
        assert abs(curve.parameters[fast] - 3000) < 4 * curve.standard_errors[fast]


def test_runs_that_something_else_than_speed_moves_are_reported() -> None:
    session = read_exchange(Path(__file__).parents[2] / "data/exchange/none-A")
    assert not analyze(session).warnings
    late = tuple(
        replace(run, touch=replace(run.touch, t_s=run.touch.t_s + 0.01 * (k % 3))) for k, run in enumerate(session.runs)
    )
    (said,) = analyze(replace(session, runs=late)).warnings
    assert "something other than speed" in said
    assert "draglag gap" in said
