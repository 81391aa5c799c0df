from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from draglag.analysis import AnalysisOptions, analyze
from draglag.analysis.planning import plan
from draglag.curve import CurvePoints, fit_form
from draglag.instruments.taps import summarise_taps
from draglag.latency.estimate import prepare
from draglag.path.motion import savitzky_golay
from draglag.protocol.runs import Protocol, RunPlan
from draglag.recording import Taps
from draglag.simulation import LatencyLaw, Rig, rig_for_screen, simulate_session, simulate_session_with_truth
from draglag.validation.misalignment import validate_run
from draglag.validation.sanity_checks import asymptote_check, clock_drifts, width_check

LAW = LatencyLaw(90.53, 4e-3, 182.9, 2.9e-2, 28.49)


def taps_about(median_s: float, n: int = 100) -> Taps:
    rng = np.random.default_rng(1)
    start = np.arange(n, dtype=float)
    latency = median_s + 2e-3 * rng.standard_normal(n)
    return Taps(np.append(start, 500.0), np.append(start + latency, 501.0), np.zeros(n + 1, np.int64))


def test_tap_medians_and_rejects() -> None:
    summary = summarise_taps(taps_about(0.0287))["release"]
    assert summary.n == 100
    assert summary.n_rejected == 1  # one second is no tap
    assert summary.ci95_s[0] < 0.0287 < summary.ci95_s[1]


def test_equivalence_of_tap_and_asymptote() -> None:
    speed = np.geomspace(44, 1000, 16)
    curve = fit_form(CurvePoints(speed, LAW.latency_s(speed), np.full(16, 2e-4)), "double_exponential")
    near = asymptote_check(curve, summarise_taps(taps_about(0.0287)))[0]
    far = asymptote_check(curve, summarise_taps(taps_about(0.036)))[0]
    assert near.equivalent
    assert near.ci95_s[0] < near.difference_s < near.ci95_s[1]
    assert not far.equivalent
    tied = fit_form(CurvePoints(speed, LAW.latency_s(speed), np.full(16, 2e-4)), "double_exponential", 0.0287)
    assert asymptote_check(tied, summarise_taps(taps_about(0.0287))) == []


@pytest.fixture(scope="module")
def measured() -> tuple[object, ...]:
    rig = replace(rig_for_screen("screen-1"), laser_clock_ppm=25.0)
    protocol = Protocol(
        name="small",
        runs=(
            RunPlan(kind="circle", speeds_mm_s=(60, 90, 140, 220, 330, 500, 800), duration_s=20.0),
            RunPlan(kind="chirp", duration_s=40.0),
            RunPlan(kind="step", duration_s=20.0),
        ),
    )
    session, truth = simulate_session_with_truth(rig, protocol, seed=4)
    return session, truth, analyze(session)


def test_a_session_is_analysed_against_its_truth(measured: tuple[object, ...]) -> None:
    _, truth, found = measured
    for run in found.runs:  # type: ignore[attr-defined]
        error = run.latency_s - truth.runs[run.id].mean_latency_s  # type: ignore[attr-defined]
        # 55 µs of the sensor's own delay are in the truth's edges.
        assert abs(error) < 5 * run.latency_se_s + 1e-4, run.id
        # Tremor of 3 mm/s at each edge is in the truth's speed, and averaged away in the estimate's.
        reach = 3 * 3.1 / np.sqrt(run.n_edges) + 0.01 * run.speed_mm_s
        assert run.speed_mm_s == pytest.approx(truth.runs[run.id].mean_speed_mm_s, abs=reach)  # type: ignore[attr-defined]
    result = found.to_dict()  # type: ignore[attr-defined]
    assert {row["protocol"] for row in result["validation_mean"]} == {"chirp", "step"}
    assert all(row["delta_J_percent"] > 90 for row in result["validation_mean"])


def test_progress_advances_with_every_run(measured: tuple[object, ...]) -> None:
    session, shown = measured[0], []
    analyze(session, progress=lambda fraction, text: shown.append((fraction, text)))  # type: ignore[arg-type]
    fractions, texts = zip(*shown, strict=True)
    assert set(texts) == {run.id for run in session.runs} | {"done"}  # type: ignore[attr-defined]
    assert np.all(np.diff(fractions) > 0)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)


def test_width_and_clock(measured: tuple[object, ...]) -> None:
    session, _, found = measured
    width = width_check(found.runs, 7.0)  # type: ignore[attr-defined]
    assert width is not None
    assert width.mean_mm == pytest.approx(7.0, abs=0.08)
    drift = clock_drifts(session)[0]  # type: ignore[arg-type]
    assert drift.ppm == pytest.approx(25.0, abs=1.0)
    assert drift.ms_per_minute == pytest.approx(1.5, abs=0.06)


def test_the_true_law_removes_nearly_all_and_none_removes_nothing(measured: tuple[object, ...]) -> None:
    session = measured[0]
    chirp = next(run for run in session.runs if run.protocol == "chirp")  # type: ignore[attr-defined]
    ready = prepare(chirp, 7.0)
    good = validate_run(ready, LAW.latency_s)
    nothing = validate_run(ready, lambda v: np.zeros(np.shape(v)))
    assert good.delta_j_percent > 99
    assert abs(nothing.delta_j_percent) < 15


def test_eq_4_is_the_papers_unless_asked(measured: tuple[object, ...]) -> None:
    """Recomputed by hand for one run: separate straight curves through the events interpolated at t and at t + L."""
    session = measured[0]
    ready = prepare(next(run for run in session.runs if run.protocol == "step"), 7.0)  # type: ignore[attr-defined]
    one = validate_run(ready, LAW.latency_s)
    a, touch = one.alignment, ready.touch
    np.testing.assert_allclose(a.y_mm, np.interp(a.edge_t_s + one.latency_s, touch.t_s, touch.y_mm))
    for x_mm, y_mm, published in (
        (a.x_raw_mm, a.y_raw_mm, one.j0_per_edge_mm2),
        (a.x_mm, a.y_mm, one.j_per_edge_mm2),
    ):
        left = 0.0
        for side in (-1, 1):
            of = a.side == side
            left += float(np.polyfit(x_mm[of], y_mm[of], 1, full=True)[1][0])
        assert published == pytest.approx(left / a.edge_t_s.size, rel=0.02)
    # The speed is the paper's: Savitzky–Golay, at the event that shows the stylus where it was at the edge.
    t_s, _, _, speed = savitzky_golay(touch)
    np.testing.assert_allclose(one.latency_s, LAW.latency_s(one.speeds_mm_s), atol=0.005)
    assert np.corrcoef(one.speeds_mm_s, np.interp(a.edge_t_s + one.latency_s, t_s, speed))[0, 1] > 0.99


def test_excluded_runs_stay_out_of_the_curve(measured: tuple[object, ...]) -> None:
    session = measured[0]
    found = analyze(session, AnalysisOptions(exclude={"run-01": "test"}))  # type: ignore[arg-type]
    assert found.curve is not None
    assert found.curve.n_points == 6


def steady_rig() -> Rig:
    return replace(rig_for_screen("screen-1"), law=LatencyLaw(0, 0, 0, 0, 60.0), run_latency_sd_s=0.0)


@pytest.mark.parametrize("law", [LatencyLaw(0, 0, 0, 0, 60.0), LAW])
def test_the_plan_foretells_what_runs_then_show(law: LatencyLaw) -> None:
    from draglag.latency import estimate_run

    protocol = Protocol(name="p", runs=(RunPlan(kind="circle", speed_mm_s=250, duration_s=16.0, repeats=100),))
    rig = replace(steady_rig(), law=law, contact_loss_per_s=0.0, sensor_response_s=0.0)
    foretold = plan(protocol, rig).runs[0]
    errors = []
    for seed in (9, 10):
        session, truth = simulate_session_with_truth(rig, protocol, seed=seed)
        errors += [(estimate_run(r, 7.0).latency_s or np.nan) - truth.runs[r.id].mean_latency_s for r in session.runs]
    # 200 runs know their own scatter to 5 %.
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(foretold.se_s, rel=0.15)


@pytest.mark.parametrize(("screen", "speed_mm_s"), [("screen-1", 60.0), ("screen-2", 250.0), ("screen-1", 900.0)])
def test_the_plan_foretells_the_interval_that_the_analysis_prints(screen: str, speed_mm_s: float) -> None:
    protocol = Protocol(name="p", runs=(RunPlan(kind="circle", speed_mm_s=speed_mm_s, repeats=12),))
    foretold = plan(protocol, screen).runs[0]
    found = [run.latency_ci95_s for run in analyze(simulate_session(screen, protocol, seed=4)).runs]
    halves_s = [0.5 * (ends[1] - ends[0]) for ends in found if ends is not None]
    assert np.mean(halves_s) == pytest.approx(foretold.half_interval_s, rel=0.15)


def test_a_plan_says_more_edges_are_better_and_too_few_speeds_make_no_curve() -> None:
    def of(duration_s: float) -> float:
        protocol = Protocol(name="p", runs=(RunPlan(kind="circle", speed_mm_s=250, duration_s=duration_s),))
        return plan(protocol, steady_rig()).runs[0].se_s

    assert of(40.0) < 0.6 * of(10.0)
    assert plan("latency-sweep", "screen-1").curve_se_s is not None
    assert plan(Protocol(name="p", runs=(RunPlan(kind="circle", speed_mm_s=250),)), "screen-1").curve_se_s is None
