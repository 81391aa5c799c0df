"""A measured session simulated again: with the cause in the model the simulation shows what was measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from draglag.exchange import read_exchange
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.fitting.law_form import flexible, knots_over
from draglag.gap.fitting.model import LawParameters
from draglag.gap.fitting.state import Term, term_signature
from draglag.gap.replaying.hand_path import hand_motion
from draglag.gap.replaying.phase import in_phase
from draglag.gap.replaying.realised import LawOfOwnForm, effects_of_fit, made
from draglag.gap.replaying.replay import Replay, replay
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.recording import FloatArray, Session, TouchTrace
from draglag.report.replayed import binned
from draglag.simulation import simulate_session
from draglag.simulation.effects import EFFECTS
from draglag.simulation.effects.smoothing_shrink.fitted import CausalWindow
from draglag.simulation.rig import rig_for_screen

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "low_speed_plateau"


def few_runs(session: Session) -> Session:
    """Seven circles and the chirp: enough for a law, quick to simulate."""
    circles = sorted((r for r in session.runs if r.nominal_speed_mm_s), key=lambda r: r.nominal_speed_mm_s or 0.0)
    kept = {r.id for r in circles[::2]} | {r.id for r in session.runs if r.protocol == "chirp"}
    return replace(session, runs=tuple(r for r in session.runs if r.id in kept))


@pytest.fixture(scope="module")
def session() -> Session:
    return few_runs(read_exchange(SAMPLE))


@pytest.fixture(scope="module")
def fits(session: Session) -> tuple[Fit, Fit]:
    runs = gather(session)
    before = fit_session(session, runs)
    return before, fit_session(session, runs, plateau=True, start=before)


@pytest.fixture(scope="module")
def replays(session: Session, fits: tuple[Fit, Fit]) -> tuple[Replay, Replay]:
    before, after = fits
    return replay(session, before), replay(session, after, reference=before)


def test_edges_fall_where_they_were_measured_once_the_cause_is_in_the_model(replays: tuple[Replay, Replay]) -> None:
    before, after = replays
    assert np.isfinite(after.simulated_s).mean() > 0.98
    assert after.rms_mm < 0.25 * before.rms_mm
    assert after.rms_ms_ci95[1] < before.rms_ms_ci95[0]
    # What is left is the position noise of the touch trace, which the fit leaves too.
    assert after.rms_mm < 0.2


def test_the_same_estimator_gives_simulated_runs_the_measured_latency(replays: tuple[Replay, Replay]) -> None:
    before, after = replays
    z = np.array([(s - m) / np.hypot(me, se) for _, _, m, me, s, se in after.latencies_ms()])
    assert z.size >= 6
    assert np.abs(z).max() < 4
    off = np.array([s - m for _, _, m, _, s, _ in before.latencies_ms()])
    assert np.abs(off).max() > 3, "without the plateau a slow run is several ms off"


def test_simulated_residuals_show_the_measured_structure(replays: tuple[Replay, Replay]) -> None:
    """The present model sees the same in both sessions once the simulation holds the cause, and nothing before."""
    before, after = replays
    assert before.simulated is not None
    assert after.simulated is not None

    def by_run(values: np.ndarray, run: np.ndarray) -> np.ndarray:
        return np.array([np.median(values[run == k]) for k in range(6)])

    measured = by_run(after.measured.late_ms, after.measured.run)
    assert np.abs(measured).max() > 2
    assert by_run(after.simulated.late_ms, after.simulated.run) == pytest.approx(measured, abs=0.5)
    assert np.abs(by_run(before.simulated.late_ms, before.simulated.run)).max() < 0.5


def test_numbers_of_the_pictures_are_plain_json(replays: tuple[Replay, Replay]) -> None:
    found = replays[1].to_dict()
    assert found["effects"] == {"low_speed_plateau": {"speed_mm_s": pytest.approx(125, abs=3)}}
    assert {"edge_rms_mm", "edge_rms_ms", "edge_rms_ms_ci95", "runs"} <= found.keys()


@pytest.mark.parametrize("name", ["clock_drift", "scan_skew", "beam_wedge", "spatial_warp"])
def test_a_fitted_effect_moves_simulated_edges_as_it_moves_measured_ones(name: str, session: Session) -> None:
    demo = load_protocol("demo")
    short = demo.model_copy(
        update={"runs": tuple(r.model_copy(update={"duration_s": 15.0}) for r in demo.runs), "taps": None}
    )
    size = EFFECTS[name].parameters[0]
    measured = simulate_session("screen-1", short, effects=[made(name, {size.name: 3 * size.typical})], seed=3)
    runs = gather(measured)
    bare = fit_session(measured, runs)
    theta = (0.0, 2.0) if name == "spatial_warp" else ()  # the class's own bend: a free one is known less well
    fit = fit_session(measured, runs, [Term(name, theta)], start=bare)
    kind = effects_of_fit(fit)[0]
    assert kind.id == ("fitted_shape" if name == "spatial_warp" else name)
    found = replay(measured, fit, reference=bare)
    assert found.rms_mm < 1.2 * np.sqrt(np.mean(fit.residual_mm**2)) + 0.02
    # The simulated session, fitted like the measured one, holds the effect in the same size.
    seen = gather(found.session)
    again = fit_session(found.session, seen, [replace(fit.terms[0], sizes=())], start=fit_session(found.session, seen))
    column = term_signature(fit.terms[0], fit.view).columns(fit.view)
    measured_mm, simulated_mm = (column @ np.array(f.terms[0].sizes) for f in (fit, again))
    n = column.shape[1]
    spread = fit.covariance[-n:, -n:] + again.covariance[-n:, -n:]
    noise_mm = np.sqrt(np.mean(np.einsum("ij,jk,ik->i", column, spread, column)))
    assert noise_mm < 0.3 * np.std(measured_mm)
    assert np.sqrt(np.mean((simulated_mm - measured_mm) ** 2)) < 3 * noise_mm


def test_a_law_of_its_own_form_is_simulated_as_fitted() -> None:
    """At the many speeds of a run it comes from a table."""
    knots = knots_over(np.geomspace(40.0, 1000.0, 200))
    eq5 = LawParameters(0.12, 0.004, 0.3, 0.025, 0.046)
    law = replace(flexible(eq5, knots), remainder_s=tuple(5e-3 * np.cos(np.arange(len(knots)))))
    simulated = LawOfOwnForm(law.a1_s, law.a2_s_mm, law.a4_s, law.a5_s_mm, 1e3 * law.a7_s + 4.0, law)
    speed = np.geomspace(0.05, 2000.0, 20_000)
    # An edge is placed to 20 µs.
    assert simulated.latency_s(speed) == pytest.approx(law(speed) + 4e-3, abs=5e-6)


def test_a_warm_up_is_simulated_with_the_time_that_its_law_was_fitted_with(
    session: Session, fits: tuple[Fit, Fit]
) -> None:
    """Its parameters lie a step away from there: with them and the fitted law runs came 1 ms late."""
    fit = fit_session(session, fits[0].runs, [Term("warm_up", (250.0,))], start=fits[0])
    (effect,) = effects_of_fit(fit, {"warm_up": {"amplitude_s": 0.02, "time_constant_s": 180.0}})
    assert effect.numbers() == {
        "amplitude_s": pytest.approx(fit.terms[0].sizes[0]),
        "time_constant_s": fit.terms[0].theta[0],
    }


def test_the_hand_behind_a_low_pass_moves_as_fast_as_its_path() -> None:
    """A law asks for the stylus' own speed: a trace that a low-pass shrinks shows a fifth less of a quick circle's."""
    effect = CausalWindow(0.045, (0.045,), (0.045**2,))
    session = simulate_session("screen-1", load_protocol("demo"), effects=[effect], seed=4)
    (quickest,) = [run for run in gather(session) if run.run.nominal_speed_mm_s == 1000.0]
    late_s = np.full(quickest.edge_t_s.size, 0.08)
    motion, _ = hand_motion(rig_for_screen("screen-1"), quickest, late_s, [effect], quickest.t_s[0])
    path_mm_s = np.gradient(np.column_stack([motion.x_mm, motion.y_mm]), motion.t_s, axis=0)
    middle = slice(motion.t_s.size // 10, -motion.t_s.size // 10)
    velocity_mm_s = np.column_stack([motion.vx_mm_s, motion.vy_mm_s])[middle]
    share = np.sum(velocity_mm_s * path_mm_s[middle]) / np.sum(path_mm_s[middle] ** 2)
    assert share == pytest.approx(1.0, abs=0.01)  # what a window of the speeds flattens of such a circle


def test_a_simulated_trace_is_moved_to_the_measured_one_whatever_events_lack_there() -> None:
    t, early_s = np.arange(0.0, 5.0, 0.008), 0.003

    def trace(at_s: FloatArray) -> TouchTrace:
        return TouchTrace(t, 50 * np.cos(5 * at_s), 50 * np.sin(5 * at_s), np.zeros(t.size, np.int64))

    measured = trace(t)
    measured.x_mm[100:110] = np.nan
    moved = in_phase(trace(t + early_s), measured, 0.05)
    np.testing.assert_allclose(moved.t_s - t, early_s, atol=1e-6)


def test_sizes_beyond_an_effect_s_bounds_are_held_at_them() -> None:
    assert made("clock_drift", {"drift_ppm": 1e6}).value == EFFECTS["clock_drift"].parameters[0].upper


def test_an_edge_of_a_stylus_that_stands_still_does_not_hide_the_others() -> None:
    """One of 200 edges, at 5 mm/s and off by 60 mm, reads as a latency of 12 s."""
    rng = np.random.default_rng(3)
    speed = np.where(np.arange(200) == 50, 5.0, 100.0)
    off_mm = np.where(np.arange(200) == 50, 60.0, 0.005 * speed + 0.05 * rng.standard_normal(200))
    late_ms = 1e3 * off_mm / speed
    limits = np.array([0.0, 1.0])
    middle, mean, reach = binned(np.full(200, 0.5), late_ms, limits, speed**2)
    assert middle.tolist() == [0.5]
    assert mean[0] == pytest.approx(5.0, abs=0.3)
    assert abs(mean[0] - 5.0) < reach[0] < 0.5
