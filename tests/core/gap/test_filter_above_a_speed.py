"""A second filter that is used above a speed between those of two runs."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from core import sound_sessions
from draglag.gap import GapReport, close_gap
from draglag.gap.fitting.joint import fit_session
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.second_filter_mode import SecondFilterMode
from draglag.simulation.effects.second_filter_mode.setting import By, Setting

EXTRA_S, ABOVE_MM_S = 0.006, 500.0


@pytest.fixture(scope="module")
def report() -> GapReport:
    """Of a filter that begins between the runs at 425 and 565 mm/s."""
    effect = parse_effect(f"second_filter_mode={EXTRA_S},threshold_mm_s={ABOVE_MM_S}")
    return close_gap(simulate_session("screen-1", load_protocol("demo"), effects=[effect], seed=21))


def test_it_is_named_and_sized(report: GapReport) -> None:
    assert report.verdict == "explained"
    assert [step.effect for step in report.steps] == ["second_filter_mode"]
    low_s, high_s = report.steps[0].parameters["extra_s"][1]
    assert low_s < EXTRA_S < high_s
    slow, fast = report.steps[0].parameters["threshold_mm_s"][1]
    assert slow < ABOVE_MM_S < fast


def test_between_any_two_speeds_a_threshold_is_compared_that_divides_neither_run() -> None:
    session = sound_sessions.demo()
    fit = fit_session(session, gather(session))
    settings = (Setting.of(one.theta) for one in SecondFilterMode.signatures(fit.view))
    thresholds = [one.above for one in settings if one is not None and one.by is By.SPEED]
    runs = [fit.view.speed[fit.run_index == k] for k in np.unique(fit.run_index) if fit.runs[k].steady]
    # Of the slowest and the fastest tenth of the edges no threshold has enough on either side.
    inside = sorted((speeds for speeds in runs if 80 < np.median(speeds) < 900), key=np.median)
    assert len(inside) == 8
    for slow, fast in pairwise(inside):
        assert any(np.mean(slow > one) < 0.1 and np.mean(fast < one) < 0.1 for one in thresholds)
