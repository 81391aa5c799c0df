"""What the workflow makes of effects that it may not name, that hide each other, or that are too small to matter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from draglag.exchange import read_exchange
from draglag.gap import close_gap
from draglag.gap.finding.scan import Candidate, Finding, find
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.fitting.parameters import where_of
from draglag.gap.fitting.state import Term
from draglag.gap.naming.choice import Name
from draglag.gap.naming.doubts import outweighed, without_idle, without_proxies, without_term
from draglag.gap.naming.refits import refit
from draglag.gap.naming.tries import judged_by
from draglag.gap.replaying.realised import FittedShape
from draglag.gap.results import Step
from draglag.gap.traces.run_data import gather
from draglag.gap.workflow import settled, step_of
from draglag.protocols import load_protocol
from draglag.recording import Session
from draglag.simulation import simulate_session
from draglag.simulation.effects import EFFECTS, parse_effect

SAMPLES = Path(__file__).parents[1] / "data" / "exchange"


def simulated(*effects: str, seed: int = 5) -> Session:
    return simulate_session("screen-1", load_protocol("demo"), effects=[parse_effect(e) for e in effects], seed=seed)


def without(*names: str) -> list[str]:
    return [effect for effect in EFFECTS if effect not in names]


@pytest.mark.parametrize(
    ("effect", "removed", "follows"),
    [
        ("beam_width=-0.8", ("beam_width", "scale_error"), "speed"),
        ("lagging_law=0.08", ("lagging_law", "acceleration_lag"), "acceleration"),
        ("sample_hold=80", ("sample_hold",), "host_tick"),
        ("frame_batching=3", ("frame_batching",), "frame"),
    ],
)
def test_an_effect_without_a_name_is_owned_up_to_and_not_misnamed(
    effect: str, removed: tuple[str, ...], follows: str
) -> None:
    report = close_gap(simulated(effect), candidates=without(*removed))
    assert report.verdict == "unexplained", [s.effect for s in report.steps]
    assert report.unexplained_by == follows
    assert report.steps == ()


def test_a_jump_along_the_panel_is_no_smooth_warp() -> None:
    sound = read_exchange(SAMPLES / "none-A")
    middle = float(np.median(np.concatenate([run.touch.x_mm for run in sound.runs])))

    def jumped(x_mm: np.ndarray, y_mm: np.ndarray) -> np.ndarray:
        return y_mm + 0.6 * (x_mm > middle)

    runs = tuple(
        replace(run, touch=replace(run.touch, y_mm=jumped(run.touch.x_mm, run.touch.y_mm))) for run in sound.runs
    )
    report = close_gap(replace(sound, runs=runs))
    assert (report.verdict, report.unexplained_by, report.steps) == ("unexplained", "x", ())


def test_a_latency_that_jumps_at_one_moment_is_no_drift() -> None:
    sound = read_exchange(SAMPLES / "none-A")
    begins_s = sorted(run.touch.t_s[0] for run in sound.runs)
    moment_s = begins_s[len(begins_s) // 2]
    runs = tuple(
        replace(run, touch=replace(run.touch, t_s=run.touch.t_s + 0.004 * (run.touch.t_s[0] >= moment_s)))
        for run in sound.runs
    )
    report = close_gap(replace(sound, runs=runs))
    assert (report.verdict, report.unexplained_by, report.steps) == ("unexplained", "session_time", ())


def test_two_effects_that_hide_each_other_are_both_named_and_sized() -> None:
    # A narrower shadow and a late return of the light cancel at one speed: neither alone shrinks the gap.
    report = close_gap(simulated("laser_hysteresis=0.0018", "beam_width=-0.8"))
    assert {s.effect for s in report.steps} == {"laser_hysteresis", "beam_width"}
    sizes = {s.effect: next(iter(s.parameters.values()))[0] for s in report.steps}
    assert sizes["laser_hysteresis"] == pytest.approx(0.0018, abs=1e-4)
    assert sizes["beam_width"] == pytest.approx(-0.8, abs=0.05)


def test_what_is_beyond_chance_but_too_small_for_a_name_is_told() -> None:
    # A ripple of less than a tenth of a millimetre: thousands of edges show it, and nobody needs it.
    report = close_gap(simulated("pitch_ripple=0.07"))
    assert report.verdict == "no_gap"
    told = {left.what: left for left in report.passed_over}
    assert "pitch_ripple" in told
    assert told["pitch_ripple"].p_value < 0.01
    assert "amplitude_mm 0.0" in told["pitch_ripple"].text
    assert [left["what"] for left in report.to_dict()["passed_over"]] == list(told)  # type: ignore[attr-defined]


def test_a_filter_that_switches_at_its_own_times_is_named_with_its_times() -> None:
    rng = np.random.default_rng(3)
    ends = np.cumsum(rng.uniform(4, 12, 120))
    switched = FittedShape(0.012, "second_filter_mode", (0.0, 2.0, *ends.tolist()), (0.012,))
    session = simulate_session("screen-1", load_protocol("demo"), effects=[switched], seed=5)
    report = close_gap(session)
    assert report.steps[0].effect == "second_filter_mode"
    value, (low, high) = report.steps[0].parameters["extra_s"]
    assert value == pytest.approx(0.012, abs=3e-4)
    assert high - low < 1e-3
    assert "stretches of time" in report.steps[0].where
    sound = close_gap(simulated())
    assert report.verdict == "explained"
    assert report.gap_last_mm is not None
    assert sound.gap_last_mm is not None
    # About each switch a window mixes both filters, a millimetre on few edges: those are left out.
    assert report.gap_last_mm < 1.1 * sound.gap_last_mm


def test_a_switching_filters_times_are_looked_for_again_beside_what_hid_them() -> None:
    ends = np.cumsum(np.random.default_rng(5).uniform(4, 12, 120))
    switched = FittedShape(0.012, "second_filter_mode", (0.0, 2.0, *ends.tolist()), (0.012,))
    asymmetry = parse_effect("direction_asymmetry=0.006")  # half of it, one way down and one way up
    report = close_gap(simulate_session("screen-1", load_protocol("demo"), effects=[switched, asymmetry], seed=5))
    assert report.verdict == "explained"
    sizes = {step.effect: next(iter(step.parameters.values())) for step in report.steps}
    assert set(sizes) == {"second_filter_mode", "direction_asymmetry"}
    low_s, high_s = sizes["direction_asymmetry"][1]
    # A switch is placed between two edges: one in a hundred on the wrong side of it moves a mean by 0.01 × 12 ms.
    assert low_s - 1e-4 < 0.006 < high_s + 1e-4
    sound = close_gap(simulated())
    assert report.gap_last_mm is not None
    assert sound.gap_last_mm is not None
    assert report.gap_last_mm < 1.15 * sound.gap_last_mm
    # What is told of it is of the model at the end, whose times were settled anew.
    assert report.last is not None
    assert report.last.only is not None
    told = next(step for step in report.steps if step.effect == "second_filter_mode")
    assert told.where == where_of("second_filter_mode", report.last)
    assert f" {np.count_nonzero(~report.last.only)} edges about its switches" in told.evidence


def test_coarse_stamps_hide_neither_a_lagging_law_nor_an_offset() -> None:
    report = close_gap(simulated("timestamp_quantisation=0.006", "lagging_law=0.1", "clock_offset=0.015"))
    named = {step.effect: step for step in report.steps}
    assert set(named) == {"timestamp_quantisation", "lagging_law", "clock_offset"}
    # Nobody knows whether taps or drags waited for the tick: half of it is in the interval.
    _, (low, high) = named["clock_offset"].parameters["offset_s"]
    assert low < 0.015 < high
    assert high - low > 0.006


def test_held_positions_hide_no_lagging_law_once_their_ages_are_undone() -> None:
    report = close_gap(simulated("sample_hold=83", "lagging_law=0.1", seed=6))
    assert {step.effect for step in report.steps} == {"sample_hold", "lagging_law"}


def test_names_that_together_close_next_to_nothing_are_withdrawn_beside_something_nameless() -> None:
    first, last = (cast("Fit", SimpleNamespace()) for _ in range(2))

    nameless = Candidate(None, "speed", "latency", 300.0, 1, 1, 0.0)

    def step(effect: str, before_mm: float, after_mm: float, fit: Fit | None = last, gain: float = 200.0) -> Step:
        return Step(effect, {}, "", "", 0.0, "", before_mm, after_mm, gain=gain, fit=fit)

    seen, idle = step("frame_drop", 0.31, 0.3, None), step("laser_hysteresis", 0.3, 0.29)
    left, fit = without_idle([seen, idle], last, first, nameless)
    assert [s.effect for s in left] == ["frame_drop"]  # the streams show it
    assert fit is first
    # Beside a larger one, an effect may close little in RMS, or nothing: the three together close most.
    chain = [step("beam_width", 1.1, 1.12), step("direction_asymmetry", 1.12, 1.1), step("clock_drift", 1.1, 0.2)]
    left, fit = without_idle(chain, last, first, nameless)
    assert left == chain
    assert fit is last
    # What is surer than the rest is there, however little of the gap it makes.
    sure = [step("laser_hysteresis", 0.3, 0.29, gain=400.0)]
    assert without_idle(sure, last, first, nameless)[0] == sure
    grown = [step("scan_skew", 0.3, 0.31, gain=400.0)]
    assert without_idle(grown, last, first, nameless)[0] == []


def test_a_surer_structure_without_a_name_outweighs_names_that_do_not_shrink_the_gap() -> None:
    fit = cast("Fit", SimpleNamespace())
    nameless = Candidate(None, "normal_acceleration", "latency", 300.0, 1, 1, 0.0)
    named = Candidate("laser_hysteresis", "", "latency", 900.0, 1, 1, 0.0)
    left = cast("Finding", SimpleNamespace(significant=(named, nameless)))

    def step(after_mm: float, gain: float, of: Fit | None = fit) -> Step:
        return Step("lagging_law", {}, "", "", 0.0, "", 0.3, after_mm, gain=gain, fit=of)

    assert outweighed([step(0.299, 200.0)], left) is nameless
    assert outweighed([step(0.28, 200.0)], left) is None  # the gap has shrunk
    assert outweighed([step(0.299, 400.0)], left) is None  # the name is surer
    assert outweighed([step(0.299, 200.0, None)], left) is None  # the streams show it


def test_runs_left_out_beside_a_name_count_again_without_it() -> None:
    """A bump at one speed may pass for a second filter; taken back, it must not leave out the run that shows it."""
    session = simulated()
    first = fit_session(session, gather(session))
    filtered = Term("second_filter_mode", (180.0, 0.0), (0.006,))
    beside = refit(session, first, [filtered], False, None, judged_by(first.placed, [filtered]))
    assert beside is not None
    assert set(beside.run_index) < set(first.run_index)
    # What is added after it is judged by the same edges, and says so.
    later = refit(session, beside, [*beside.terms, Term("clock_drift", ())], False)
    assert later is not None
    assert beside.only is not None
    assert later.only is not None
    np.testing.assert_array_equal(later.only, beside.only)
    for fit, left in ((beside, []), (later, ["clock_drift"])):
        back = without_term(session, fit, "second_filter_mode", first)
        assert back is not None
        assert set(back.run_index) == set(first.run_index)
        assert [term.effect for term in back.terms] == left


def test_a_step_tells_the_edges_that_the_last_fit_leaves_out() -> None:
    session = simulated()
    first = fit_session(session, gather(session))
    filtered = Term("second_filter_mode", (180.0, 0.0), (0.006,))
    whole = refit(session, first, [filtered], False)
    beside = refit(session, first, [filtered], False, None, judged_by(first.placed, [filtered]))
    assert whole is not None
    assert beside is not None
    assert beside.only is not None
    words = f"; {np.count_nonzero(~beside.only)} edges about its switches are of neither filter, and left out"
    for before in (whole, beside):
        named = Name("second_filter_mode", before, 50.0, 0.3, 0.2, True)
        step = step_of(session, [named], find(first), frozenset(EFFECTS))
        assert settled(step, beside).evidence == "deviance falls by 50 after its price" + words


@pytest.mark.parametrize(("truth", "kept"), [((), ["beam_width"]), (("laser_hysteresis=0.0018",), None)])
def test_an_earlier_name_is_looked_at_again_beside_the_newest(truth: tuple[str, ...], kept: list[str] | None) -> None:
    session = simulated("beam_width=-0.8", *truth)
    first = fit_session(session, gather(session))
    both = refit(session, first, [Term("laser_hysteresis", ()), Term("beam_width", ())], False)
    assert both is not None
    steps = [Step(term.effect, {}, "", "", 0.0, "", 0.3, 0.2, fit=both) for term in both.terms]
    fit, left = without_proxies(session, both, steps, first)
    named = kept or ["laser_hysteresis", "beam_width"]
    assert [step.effect for step in left] == [term.effect for term in fit.terms] == named
