"""The joint fit finds the law wherever it begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from core import sound_sessions
from draglag.errors import EstimateError
from draglag.exchange import read_exchange
from draglag.gap import GapReport, close_gap
from draglag.gap.constants import GIVEN_UP, GROWS_BY, PREDICTS_NATS, PROMISING
from draglag.gap.fitting import heldout, joint
from draglag.gap.fitting.heldout import floor_mm, gap_mm
from draglag.gap.fitting.joint import Fit, fit_session, gained_nats
from draglag.gap.fitting.likelihood import Downhill, cost_without_nuisances, downhill
from draglag.gap.fitting.model import LawParameters
from draglag.gap.fitting.noise import Components, scatter
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.fitting.state import Term, linearise
from draglag.gap.fitting.whitening import whitener
from draglag.gap.proposing.plain import refit
from draglag.gap.proposing.proposals import refits_with, shown_by_traces
from draglag.gap.traces.run_data import RunData, gather
from draglag.protocol.runs import Protocol, load_protocol
from draglag.recording import FloatArray, Run, Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.lagging_law import refits as lagging
from draglag.simulation.effects.speed_adaptive_filter import USUAL, SpeedAdaptiveFilter
from draglag.simulation.law import LatencyLaw
from draglag.simulation.rig import rig_for_screen

LIKELY = 4.0  # a difference of log-likelihood that means nothing


def short_demo() -> Protocol:
    """Circles of the demo, a quarter of a minute each."""
    demo = load_protocol("demo")
    runs = tuple(r.model_copy(update={"duration_s": 15.0}) for r in demo.runs if r.kind == "circle")
    return demo.model_copy(update={"runs": runs, "taps": None})


def simulated(*effects: str) -> Session:
    return simulate_session("screen-2", short_demo(), effects=[parse_effect(e) for e in effects], seed=11)


@pytest.fixture(scope="module")
def plain() -> tuple[Session, Fit]:
    session = simulated()
    return session, fit_session(session, gather(session))


@pytest.mark.parametrize(
    ("slow", "fast"), [(0.002, 0.004), (0.009, 0.14), (0.012, 0.013)], ids=["both slow", "both fast", "both alike"]
)
def test_poor_rates_to_begin_with_do_not_matter(plain: tuple[Session, Fit], slow: float, fast: float) -> None:
    session, best = plain
    poor = replace(best.law, a1_s=0.06, a2_s_mm=slow, a4_s=0.06, a5_s_mm=fast)
    again = fit_session(session, best.runs, start=best, law=poor)
    assert again.log_likelihood == pytest.approx(best.log_likelihood, abs=LIKELY)


@pytest.fixture(scope="module")
def without_its_drift() -> Fit:
    session = simulated("clock_drift=20")
    return fit_session(session, gather(session))


@pytest.mark.parametrize("damping", [0.0, 1.0, 100.0])
def test_a_step_keeps_what_it_promises(damping: float, without_its_drift: Fit) -> None:
    """Where edges are moved as far as the step says, the cost falls by what was promised, nuisances at their best."""
    fit = without_its_drift
    state = linearise(fit.runs, fit.law, fit.geometry, [Term("clock_drift")], fit.width_mm, None)
    use = fit.use & state.placed.ok
    calm = Components(slow_mm=2.0)  # no edge so far off that it pulls with less than its square
    white = whitener(scatter(fit.runs, state.placed, use, state.blur_mm), calm)
    down = downhill(white, state, use)
    step, promised = down.step(damping)
    there = replace(state, residual=state.residual - state.design @ step)
    assert promised > 0.1
    assert down.cost - cost_without_nuisances(white, there, use) == pytest.approx(promised, rel=1e-3)


@pytest.mark.parametrize(("there", "within"), [(False, 0.1), (True, 0.01)], ids=["without the filter", "with it"])
def test_a_fit_that_begins_where_it_ended_stays_there(plain: tuple[Session, Fit], there: bool, within: float) -> None:
    """A size with a prior is drawn back by it, or it would creep on with every step."""
    session, base = plain
    if there:
        session = simulated(f"speed_adaptive_filter={USUAL.fmin_hz},beta_per_mm={USUAL.beta_per_mm}")
        base = fit_session(session, gather(session))
    term = Term(SpeedAdaptiveFilter.id, USUAL, (0.0, 0.0))
    ended = fit_session(session, base.runs, [term], start=base, law=base.law)
    again = fit_session(session, base.runs, ended.terms, start=base, law=ended.law)
    assert again.terms[0].sizes == pytest.approx(ended.terms[0].sizes, abs=within * SpeedAdaptiveFilter.prior_sd)


def step_at_the_end_of(fit: Fit) -> tuple[FloatArray, float]:
    """Step that a fit's own weights ask for where it ended, and the nats that it promises."""
    state = linearise(fit.runs, fit.law, fit.geometry, fit.terms, fit.width_mm, None)
    state = linearise(fit.runs, fit.law, fit.geometry, state.terms, fit.width_mm, state)
    return downhill(fit.white, state, fit.use).step(0.0)


@pytest.mark.parametrize("flat", [False, True], ids=["falling law", "flat law"])
@pytest.mark.parametrize("effect", ["smoothing_shrink", "clock_drift"])
def test_at_the_end_of_a_refit_no_step_promises_more(effect: str, flat: bool) -> None:
    """Where the noise turns out another than the search took it for, and where a law lies at its bounds, too."""
    rig = replace(rig_for_screen("screen-2"), run_latency_sd_s=0.0)
    if flat:
        rig = replace(rig, law=LatencyLaw(0.0, 0.01, 0.0, 0.01, 80.0))
    size = {"smoothing_shrink": 0.033, "clock_drift": 30.0}[effect]
    session = simulate_session(rig, short_demo(), effects=[parse_effect(f"{effect}={size}")], seed=11)
    refitted = refits_with(session, fit_session(session, gather(session)), effect, ())
    assert refitted
    for fit in refitted:
        assert step_at_the_end_of(fit)[1] < LIKELY


@pytest.mark.parametrize("seed", range(20))
def test_a_step_is_the_best_within_the_laws_limits(seed: int) -> None:
    """No step nearby within them is better: the cost falls along none of the ways that they leave open."""
    rng = np.random.default_rng(seed)
    law = LawParameters(rng.choice([1e-4, 0.05]), rng.choice([3e-4, 0.15]), 1.1e-4, 0.02, 0.05)
    columns = rng.normal(size=(30, 12)) @ rng.normal(size=(12, 12))
    down = Downhill(law, columns.T @ columns, columns.T @ rng.normal(size=30), np.zeros(12), 0.0)
    step, promised = down.step(0.0)
    limits = np.full((2, 12), [[-np.inf], [np.inf]])
    limits[:, :5] = law.step_limits
    slack = 1e-9 * np.abs(step).max()
    assert np.all((step >= limits[0] - slack) & (step <= limits[1] + slack))
    for other in np.clip(step + 0.01 * rng.normal(size=(500, 12)), *limits):
        assert other @ down.slope - 0.5 * other @ down.curvature @ other <= promised + 1e-9 * abs(promised)


def test_a_law_far_off_to_begin_with_costs_no_edges(plain: tuple[Session, Fit]) -> None:
    session, best = plain
    far = fit_session(session, best.runs, law=replace(best.law, a7_s=best.law.a7_s + 0.09))
    for k in range(len(best.runs)):
        assert np.count_nonzero(far.run_index == k) >= 0.9 * np.count_nonzero(best.run_index == k)


def test_a_law_that_no_edge_can_be_placed_by_is_refused(plain: tuple[Session, Fit]) -> None:
    session, best = plain
    hopeless = replace(best.law, a7_s=3.0)
    with pytest.raises(EstimateError, match="no edge"):
        fit_session(session, best.runs, start=best, law=hopeless)


@pytest.mark.parametrize("skew_s", [0.02, 0.04])
def test_edges_next_to_holes_in_the_trace_stop_no_search(skew_s: float) -> None:
    """An edge that a step moves next to a hole may lie anywhere: one such edge used to refuse every step."""
    sound = read_exchange(Path(__file__).parents[2] / "data" / "exchange" / "none-A")

    def skewed(run: Run) -> Run:
        touch = run.touch
        seen = (touch.t_s - touch.t_s[0]) % 2.9 > 0.11
        t_s = touch.t_s + skew_s * touch.x_mm / sound.screen.width_mm
        return replace(run, touch=TouchTrace(t_s[seen], touch.x_mm[seen], touch.y_mm[seen]))

    session = replace(sound, runs=tuple(skewed(run) for run in sound.runs))
    runs = gather(session)
    fit = fit_session(session, runs, [Term("scan_skew")], start=fit_session(session, runs))
    assert fit.terms[0].sizes[0] == pytest.approx(skew_s, rel=0.02)
    assert gap_mm(fit) < 1.1 * gap_mm(fit_session(sound, gather(sound)))


def test_a_plateau_is_found_from_either_side() -> None:
    session = simulated("low_speed_plateau=150")
    runs = gather(session)
    fits = [
        fit_session(session, runs, plateau=True, law=replace(law, plateau_mm_s=law.plateau_mm_s * share))
        for law in [fit_session(session, runs, plateau=True).law]
        for share in (0.75, 1.3)
    ]
    for fit in fits:
        se_mm_s = fit.covariance[5, 5] ** 0.5
        # One run gives where the law begins to fall, at 0.27 ms a mm/s: its own latency (0.3 ms), its speed's 1 % too.
        assert fit.law.plateau_mm_s == pytest.approx(150, abs=4 * (se_mm_s**2 + (0.3 / 0.27) ** 2 + 1.8**2) ** 0.5)
        assert se_mm_s < 5


def test_the_corner_of_a_plateau_is_rounded_by_less_than_a_speed_is_unsure() -> None:
    law = LawParameters(0.0, 0.004, 0.2, 0.02, 0.03, 100.0)
    sharp = replace(law, plateau_mm_s=0.0)
    speed = np.array([20.0, 90.0, 110.0, 300.0])
    assert law(speed) == pytest.approx(sharp(np.maximum(speed, 100.0)), abs=2e-5)
    gradient = law.columns(speed)[:, 5]
    moved = replace(law, plateau_mm_s=100.01)(speed) - law(speed)
    assert gradient == pytest.approx(moved / 0.01, rel=0.02, abs=1e-9)


Refitted = tuple[GapReport, list[tuple[Fit, tuple[Term, ...]]]]  # of each refit: the smaller fit, all terms


def lagging_law(seed: int) -> Refitted:
    """Report of a law that lags by 100 ms, and what was refitted for it."""
    session = simulate_session("screen-1", load_protocol("demo"), effects=[parse_effect("lagging_law=0.1")], seed=seed)
    refitted: list[tuple[Fit, tuple[Term, ...]]] = []

    def fitted(
        session: Session,
        runs: tuple[RunData, ...],
        terms: Sequence[Term],
        plateau: bool,
        start: Fit,
        law: LawParameters,
    ) -> Fit:
        refitted.append((start, tuple(terms)))
        return fit_session(session, runs, terms, plateau, start, law)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("draglag.gap.proposing.plain.fit_session", fitted)
        return close_gap(session), refitted


def test_a_lagging_law_is_sized_by_the_speed_of_that_time() -> None:
    """The interval covers it: of which moment a speed is, its windows give to 10 ms and a fifth of the delay only."""
    report, _ = lagging_law(seed=5)
    (step,) = report.steps
    assert step.effect == "lagging_law"
    delay_s, (low_s, high_s) = step.parameters["delay_s"]
    assert low_s < 0.1 < high_s
    assert high_s - low_s < delay_s
    assert report.gap_first_mm is not None
    assert report.gap_last_mm is not None
    assert report.gap_last_mm < 0.9 * report.gap_first_mm


def test_no_refit_is_made_twice() -> None:
    """Each takes seconds on a long session: next to the lagging law several sets promise more and begin alike."""
    _, refitted = lagging_law(seed=6)
    assert len(refitted) > 3
    again = [terms for k, (start, terms) in enumerate(refitted) if (start, terms) in refitted[:k]]
    assert again == []


@pytest.mark.parametrize("seed", [7, 8])
def test_an_interval_holds_a_drift_although_runs_scatter_more_than_noise_may(seed: int) -> None:
    """Four times what the fit grants runs: then only the runs themselves show how sure a drift is."""
    session = simulate_session("screen-1", load_protocol("demo"), effects=[parse_effect("clock_drift=30")], seed=seed)
    rng = np.random.default_rng(seed)

    def late(run: Run) -> Run:
        return replace(run, touch=replace(run.touch, t_s=run.touch.t_s + rng.normal(0, 0.004)))

    scattered = replace(session, runs=tuple(map(late, session.runs)))
    fit = fit_session(scattered, gather(scattered), [Term("clock_drift", ())])
    low, high = parameters_of("clock_drift", fit)["drift_ppm"][1]
    assert low < 30 < high
    assert high - low < 15


@lru_cache
def without_its_skew(first: Components) -> Fit:
    """Found with these weights to begin with."""
    session = sound_sessions.brief("scan_skew=0.02")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(joint, "START", first)
        return fit_session(session, gather(session))


@pytest.mark.parametrize("first", [joint.START, Components()], ids=["usual", "other"])
@pytest.mark.parametrize("effect", ["beam_width", "direction_asymmetry", "clock_drift", "laser_hysteresis"])
def test_a_refit_is_no_less_likely_than_the_fit_without_its_effect(
    effect: str, first: Components, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The larger model contains the smaller, whatever weights a search begins with, also where both lack an effect."""
    fit = without_its_skew(first)
    monkeypatch.setattr(joint, "START", first)
    again = refit(sound_sessions.brief("scan_skew=0.02"), fit, [Term(effect)])
    assert again is not None
    # Weights are those of either fit: the same edges may count a few nats more or less.
    assert gained_nats(fit, again) > -GIVEN_UP


@pytest.mark.parametrize("also", [(), ("lagging_law=0.1",)])
def test_traces_show_a_lagging_law_next_to_what_explains_more(also: tuple[str, ...]) -> None:
    session = simulated("scan_skew=0.01", *also)
    first = fit_session(session, gather(session))
    (skewed,) = refits_with(session, first, "scan_skew", ())
    assert (shown_by_traces(skewed, "lagging_law") > PROMISING) is bool(also)


@pytest.mark.parametrize(
    ("sound", "other", "made"),
    [(0.0, -30.0, False), (0.0, 30.0, True), (-np.inf, 0.0, True), (0.0, -np.inf, False)],
)
def test_a_lagging_law_is_refitted_unless_every_delay_is_far_less_likely(
    sound: float, other: float, made: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice the log-likelihood of delays of sound panels, and of others; −∞ where too few edges can be placed."""
    session = sound_sessions.brief("scan_skew=0.02")
    sounds = len(lagging.USUAL)
    monkeypatch.setattr(
        lagging, "delay_profile", lambda fit, options: np.array([sound] * sounds + [other] * (len(options) - sounds))
    )
    asked: list[Term] = []
    monkeypatch.setattr(lagging, "refit", lambda session, before, terms: asked.append(terms[-1]))
    first = fit_session(session, gather(session))
    assert lagging.refits(session, first, ()) == []
    assert bool(asked) is made


@pytest.mark.parametrize(("ratio", "no_worse"), [(0.6, True), (1.07, True), (1.09, False)])
def test_what_misses_a_fast_run_by_more_is_no_better_whatever_it_predicts(
    plain: tuple[Session, Fit], monkeypatch: pytest.MonkeyPatch, ratio: float, no_worse: bool
) -> None:
    """All other runs are missed by a third, and the fast run by so much that the RMS is this many times as before, or
    as its noise floor was."""
    monkeypatch.setattr(heldout, "predictive_gain", lambda before, after: 100 * PREDICTS_NATS)
    before = plain[1]
    nominal_mm_s = np.array([data.run.nominal_speed_mm_s for data in before.runs])[before.run_index]
    fast = nominal_mm_s == nominal_mm_s[heldout.folds(before) != heldout.IN_EVERY_FIT].max()

    def missed_by(times: float) -> Fit:
        return replace(before, residual_mm=before.residual_mm * np.where(fast, times, 0.3))

    was_mm = max(gap_mm(before, whole=True), floor_mm(before, whole=True))
    after = missed_by(brentq(lambda times: gap_mm(missed_by(times), whole=True) - ratio * was_mm, 0.3, 10.0))
    assert (gap_mm(after, whole=True) < (1 + GROWS_BY) * was_mm) == no_worse
    assert heldout.shrinks_or_predicts(before, after) == no_worse


def test_what_only_the_fastest_run_showed_is_no_growth_where_others_are_held_out(
    plain: tuple[Session, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The fastest and the slowest run are in every fit: one without the effect misses them and hits the others."""
    after, before = plain[1], replace(plain[1])
    extreme = heldout.folds(after) == heldout.IN_EVERY_FIT
    missed_mm = {id(before): np.where(extreme, 0.6, 0.2), id(after): np.where(extreme, 0.2, 0.25)}
    monkeypatch.setattr(heldout, "held_out_residual_mm", lambda fit: missed_mm[id(fit)])
    monkeypatch.setattr(heldout, "noise_variance_mm2", lambda fit: np.full(extreme.size, 0.15**2))
    monkeypatch.setattr(heldout, "predictive_gain", lambda before, after: 100 * PREDICTS_NATS)
    assert gap_mm(after) > (1 + GROWS_BY) * gap_mm(before)
    assert heldout.shrinks_or_predicts(before, after)


def test_what_one_run_alone_shows_is_predicted_as_widely_as_it_is_open(plain: tuple[Session, Fit]) -> None:
    """A run 5 mm off disproves a model by hundreds of nats, but none in which it alone shows a size of 10 mm."""
    fit = plain[1]
    run = fit.run_index[np.flatnonzero(heldout.folds(fit) != heldout.IN_EVERY_FIT)[0]]
    own = (fit.run_index == run).astype(float)
    off = replace(fit, residual_mm=fit.residual_mm + 5.0 * own)
    opened = replace(off, design=np.column_stack([off.design, own]), prior=np.append(off.prior, 10.0**-2))
    assert heldout.predictive_gain(off, opened) > 100.0
