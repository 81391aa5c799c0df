"""A screen that extrapolates: drags are shown early, taps are not, and circles are shown too large."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from draglag.gap import close_gap
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.recording import Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.prediction.noise import nats_against

HORIZON_S, WINDOW_S = 0.025, 0.02


@pytest.fixture(scope="module")
def extrapolated() -> Session:
    effect = parse_effect(f"prediction={HORIZON_S},window_s={WINDOW_S}")
    return simulate_session("screen-1", load_protocol("demo"), effects=[effect], seed=11)


def test_taps_and_curves_size_a_prediction(extrapolated: Session) -> None:
    report = close_gap(extrapolated)
    assert [step.effect for step in report.steps] == ["prediction"]
    assert report.verdict == "explained"
    parameters = report.steps[0].parameters
    for name, truth in (("horizon_s", HORIZON_S), ("window_s", WINDOW_S)):
        _, (low, high) = parameters[name]
        assert low <= truth <= high, (name, parameters)
    # Its noise, which an extrapolation multiplies, is undone with it: what is left is as small as noise leaves it.
    assert report.gap_last_mm is not None
    assert report.noise_floor_mm is not None
    assert report.gap_last_mm < 1.3 * report.noise_floor_mm


def test_without_taps_curves_alone_show_a_prediction(extrapolated: Session) -> None:
    report = close_gap(replace(extrapolated, taps=None))
    assert [step.effect for step in report.steps] == ["prediction"]
    _, (low, high) = report.steps[0].parameters["horizon_s"]
    assert low <= HORIZON_S <= high


def tracked(touch: TouchTrace, tau_s: float, ahead_s: float) -> TouchTrace:
    """Touch events behind an alpha-beta tracker, shown ahead by its velocity."""
    alpha = 1 - np.exp(-np.append(1.0, np.diff(touch.t_s)) / tau_s)
    shown = []
    for places in (touch.x_mm, touch.y_mm):
        at, speed, out = float(places[0]), 0.0, [float(places[0])]
        for share, dt_s, place in zip(alpha[1:], np.diff(touch.t_s), places[1:], strict=True):
            expected = at + speed * dt_s
            at = expected + share * (place - expected)
            speed += share**2 / (2 - share) * (place - expected) / dt_s
            out.append(at + ahead_s * speed)
        shown.append(np.array(out))
    return replace(touch, x_mm=shown[0], y_mm=shown[1])


@pytest.mark.parametrize("ahead_s", [0.0, 0.01])
def test_a_tracker_that_swings_wide_is_no_prediction(ahead_s: float) -> None:
    """It moves edges like an extrapolation, and smooths the noise that an extrapolation would multiply."""
    sound = simulate_session("screen-1", load_protocol("demo"), seed=11)
    runs = tuple(replace(run, touch=tracked(run.touch, 0.012, ahead_s)) for run in sound.runs)
    report = close_gap(replace(sound, runs=runs, taps=None))
    assert "prediction" not in [step.effect for step in report.steps]


@pytest.mark.parametrize("horizon_s", [0.005, 0.01, HORIZON_S])
def test_the_noise_of_an_extrapolation_does_not_speak_against_it(horizon_s: float) -> None:
    effect = parse_effect(f"prediction={horizon_s},window_s={WINDOW_S}")
    session = simulate_session("screen-1", load_protocol("demo"), effects=[effect], seed=11)
    assert nats_against(gather(session)) < 0
