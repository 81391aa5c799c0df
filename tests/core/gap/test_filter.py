"""A 1 euro filter: its inverse, and its way through the workflow; a panel's rate and the events that are averaged."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from core import sound_sessions
from draglag.gap import close_gap
from draglag.gap.constants import GIVEN_UP, HAND_STEP_S
from draglag.gap.fitting.joint import Fit, fit_session, gained_nats
from draglag.gap.results import GapReport
from draglag.gap.traces.run_data import averaged, gather
from draglag.path.events import first_of_contact
from draglag.protocol.runs import load_protocol
from draglag.recording import FloatArray, LaserTrace, Run, Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.effects import EFFECTS, parse_effect
from draglag.simulation.effects.speed_adaptive_filter import SETTINGS as SETTINGS_TRIED
from draglag.simulation.effects.speed_adaptive_filter import SMOOTHER_SD
from draglag.simulation.effects.speed_adaptive_filter.filtering import (
    Setting,
    filtered,
    unfiltered,
)
from draglag.simulation.effects.speed_adaptive_filter.refits import LEAST_SHARE, refits, shown_share

SETTINGS = [Setting(0.6, 0.01), Setting(1.0, 0.02), Setting(1.5, 0.05)]
FMIN_HZ, BETA_PER_MM = 1.0, 0.02


def drag(seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Noisy circles of 40 to 400 mm/s, with jittering stamps and a lost contact."""
    rng = np.random.default_rng(seed)
    t_s = np.cumsum(rng.normal(1 / 120, 2e-4, 2400))
    t_s[1200:] += 0.4
    angle = np.cumsum(np.linspace(1, 10, 2400)) / 120
    return t_s, 40 * np.column_stack([np.cos(angle), np.sin(angle)]) + rng.normal(0, 0.1, (2400, 2))


def as_published(t_s: FloatArray, xy_mm: FloatArray, setting: Setting) -> FloatArray:
    """The recursion of Casiez et al. 2012 for points, step by step."""

    def gain(cut_off_hz: float, step_s: float) -> float:
        return 1 / (1 + 1 / (2 * math.pi * cut_off_hz * step_s))

    out, velocity = xy_mm.copy(), np.zeros(2)
    for i in range(1, t_s.size):
        step_s = float(t_s[i] - t_s[i - 1])
        velocity = velocity + gain(1.0, step_s) * ((xy_mm[i] - xy_mm[i - 1]) / step_s - velocity)
        own = gain(setting.fmin_hz + setting.beta_per_mm * float(np.hypot(*velocity)), step_s)
        out[i] = out[i - 1] + own * (xy_mm[i] - out[i - 1])
    return out


@pytest.mark.parametrize("setting", SETTINGS)
def test_the_filter_is_the_published_one_in_each_contact(setting: Setting) -> None:
    t_s, xy_mm = drag()
    first = first_of_contact(t_s)
    assert np.flatnonzero(first).tolist() == [0, 1200]
    expected = np.vstack([as_published(t_s[part], xy_mm[part], setting) for part in (slice(1200), slice(1200, None))])
    assert filtered(t_s, xy_mm, setting, first) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("setting", SETTINGS)
def test_raw_positions_come_back_from_filtered_ones(setting: Setting) -> None:
    t_s, xy_mm = drag()
    first = first_of_contact(t_s)
    assert unfiltered(t_s, filtered(t_s, xy_mm, setting, first), setting, first) == pytest.approx(xy_mm, abs=1e-3)


@pytest.fixture(scope="module")
def session() -> Session:
    effect = parse_effect(f"speed_adaptive_filter={FMIN_HZ},beta_per_mm={BETA_PER_MM}")
    return simulate_session("screen-1", load_protocol("demo"), effects=[effect], seed=5)


@pytest.fixture(scope="module")
def report(session: Session) -> GapReport:
    return close_gap(session)


def test_it_is_named_and_sized_and_the_gap_is_that_of_the_session_without_it(report: GapReport) -> None:
    assert [step.effect for step in report.steps] == ["speed_adaptive_filter"]
    for name, true in (("fmin_hz", FMIN_HZ), ("beta_per_mm", BETA_PER_MM)):
        value, (low, high) = report.steps[0].parameters[name]
        # An interval of 95 % misses one time in twenty; its half width once more misses one in 10 000.
        assert low - (value - low) < true < high + (high - value)
        assert high / low < 3
    sound_mm = sound_sessions.gap_mm(sound_sessions.report_of_demo())
    assert report.gap_first_mm > 2 * sound_mm
    assert report.gap_last_mm < 1.3 * sound_mm


def begun(*effects: str) -> tuple[Session, Fit]:
    """Circles of 15 s, and the fit without any effect."""
    demo = load_protocol("demo")
    runs = tuple(r.model_copy(update={"duration_s": 15.0}) for r in demo.runs if r.kind == "circle")
    protocol = demo.model_copy(update={"runs": runs, "taps": None})
    session = simulate_session("screen-2", protocol, effects=[parse_effect(e) for e in effects], seed=11)
    return session, fit_session(session, gather(session))


@pytest.mark.parametrize("logs", [(-1.0, -1.0), (0.0, 0.0), (1.0, -1.0), (1.0, 1.0)])
def test_a_filter_of_any_screen_is_found_from_the_nearest_one_tried(logs: tuple[float, float]) -> None:
    # Two standard deviations among screens in either direction.
    setting = Setting(FMIN_HZ, BETA_PER_MM).moved(np.array(logs))
    effect = f"speed_adaptive_filter={setting.fmin_hz},beta_per_mm={setting.beta_per_mm}"
    nearest = min(SETTINGS_TRIED, key=lambda tried: float(np.sum(tried.logs_from(setting) ** 2)))
    (found,) = refits(*begun(effect), nearest)
    seen = Setting(*found.terms[-1].theta)
    assert np.all(np.abs(seen.logs_from(setting)) < 4 * np.hypot(seen.unsure, SMOOTHER_SD))


def test_a_filter_is_seen_next_to_a_stronger_effect_that_is_not_fitted() -> None:
    effect = f"speed_adaptive_filter={FMIN_HZ},beta_per_mm={BETA_PER_MM}"
    session, fit = begun(effect, "direction_asymmetry=0.006")
    (found,) = refits(session, fit, ())
    assert gained_nats(fit, found) > GIVEN_UP
    assert share_of_columns(effect, "direction_asymmetry=0.006") > 2 * LEAST_SHARE


def share_of_columns(*effects: str) -> float:
    """Of a filter's columns at the setting that shows the most of them, on circles of 15 s."""
    _, fit = begun(*effects)
    return max(shown_share(fit, setting) for setting in SETTINGS_TRIED)


@pytest.mark.parametrize("logs", [(-1.0, -1.0), (0.0, 0.0), (1.0, -1.0), (1.5, 1.5)])
def test_a_filter_of_any_screen_is_there_as_a_whole(logs: tuple[float, float]) -> None:
    # Two standard deviations among screens in either direction, and about the quickest that is looked for.
    setting = Setting(FMIN_HZ, BETA_PER_MM).moved(np.array(logs))
    effect = f"speed_adaptive_filter={setting.fmin_hz},beta_per_mm={setting.beta_per_mm}"
    assert share_of_columns(effect) > 2 * LEAST_SHARE


@pytest.mark.parametrize("effects", [(), ("beam_width=0.3",), ("spatial_warp=0.3",), ("scan_skew=0.01",)])
def test_of_other_effects_a_smaller_share_is_seen(effects: tuple[str, ...]) -> None:
    assert share_of_columns(*effects) < LEAST_SHARE


@pytest.mark.parametrize("effects", [(), ("beam_width=0.3",), ("spatial_warp=0.3",), ("scan_skew=0.01",)])
def test_what_is_no_filter_is_not_refitted_as_one(effects: tuple[str, ...]) -> None:
    assert refits(*begun(*effects), ()) == []


def test_a_filter_that_moved_before_the_trace_began_is_found(session: Session) -> None:
    """Nobody knows its velocity then: the first edges are unsure, and decide nothing."""

    def later(run: Run) -> Run:
        from_s = run.touch.t_s[0] + 0.7
        seen = run.touch.t_s > from_s
        one = run.touch
        keep = run.laser.t_s > from_s
        return replace(
            run,
            touch=TouchTrace(one.t_s[seen], one.x_mm[seen], one.y_mm[seen]),
            laser=LaserTrace(run.laser.t_s[keep], run.laser.light[keep]),
        )

    report = close_gap(replace(session, runs=tuple(map(later, session.runs))))
    assert (report.verdict, [step.effect for step in report.steps]) == ("explained", ["speed_adaptive_filter"])


def test_simulated_again_it_lies_where_it_was_measured(report: GapReport) -> None:
    assert {one.name for one in report.check} >= {"latency by run", "stylus width", "scatter of edges"}
    assert all(one.agrees for one in report.check)


def test_without_it_in_the_library_something_is_left_unexplained(session: Session) -> None:
    assert close_gap(session, candidates=set(EFFECTS) - {"speed_adaptive_filter"}).verdict == "unexplained"


def test_a_law_that_lags_no_more_than_a_sound_panels_is_not_named() -> None:
    session = simulate_session("screen-1", load_protocol("demo"), effects=[parse_effect("lagging_law=0.015")], seed=5)
    assert "lagging_law" not in [step.effect for step in close_gap(session).steps]


def test_events_finer_than_the_fits_need_are_averaged_within_each_contact() -> None:
    t_s = np.arange(4000) * 1e-3
    t_s[2001:] += 0.3  # a contact lost after an uneven number of events
    xy_mm = np.column_stack([100 * t_s, 5 - 30 * t_s])
    fewer_s, fewer_mm = averaged(t_s, xy_mm)
    assert fewer_s.size == math.ceil(2001 / 4) + math.ceil(1999 / 4)
    assert fewer_mm == pytest.approx(np.column_stack([100 * fewer_s, 5 - 30 * fewer_s]))
    assert not np.any((fewer_s > t_s[2000]) & (fewer_s < t_s[2001]))
    assert np.median(np.diff(fewer_s)) == pytest.approx(HAND_STEP_S)
    as_they_are = averaged(t_s[::4], xy_mm[::4])
    assert as_they_are[0].size == t_s[::4].size
