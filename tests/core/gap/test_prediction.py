"""A screen that extrapolates: drags are shown early, taps are not, and circles are shown too large."""

from __future__ import annotations

from dataclasses import replace

import pytest

from draglag.gap import close_gap
from draglag.protocol.runs import load_protocol
from draglag.recording import Session
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect

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
