"""A second filter above a speed that no run crosses: Eq. 5 bends until it nearly hides the step."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from draglag.gap import close_gap
from draglag.protocol.runs import load_protocol
from draglag.recording import Session
from draglag.simulation import rig_for_screen, simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.second_filter_mode.stepped import find_step
from draglag.simulation.law import LatencyLaw

LATER_S = 0.0117
LAW = LatencyLaw(14.5, 0.00345, 220.0, 0.0195, 31.75)  # of a session of the benchmark whose step was taken for scatter


def circles(threshold_mm_s: float, seed: int) -> Session:
    """Twelve circles of 54 to 930 mm/s, later above a threshold."""
    demo = load_protocol("demo")
    speeds = np.geomspace(54.0, 930.0, 12).round()
    one = next(run for run in demo.runs if run.kind == "circle")
    runs = (one.model_copy(update={"speeds_mm_s": tuple(map(float, speeds)), "duration_s": 20.0}),)
    effect = parse_effect(f"second_filter_mode={LATER_S},threshold_mm_s={threshold_mm_s}")
    protocol = demo.model_copy(update={"runs": runs, "taps": None})
    return simulate_session(replace(rig_for_screen("screen-1"), law=LAW), protocol, effects=[effect], seed=seed)


@pytest.mark.parametrize(
    ("threshold_mm_s", "seed"),
    [
        (157.0, 1),  # without it something in speed had no name
        (300.0, 2),  # without it runs scattered more than those of panels do
    ],
)
def test_a_step_between_two_runs_is_no_scatter_of_runs(threshold_mm_s: float, seed: int) -> None:
    report = close_gap(circles(threshold_mm_s, seed))
    assert report.verdict == "explained"
    (step,) = report.steps
    assert step.effect == "second_filter_mode"
    _, (low, high) = step.parameters["extra_s"]
    assert low < LATER_S < high
    _, (low, high) = step.parameters["threshold_mm_s"]
    assert low < threshold_mm_s < high


@pytest.mark.parametrize("later_s", [0.01, 0.02, 0.03])
def test_a_step_larger_than_the_curve_falls_lies_between_its_runs(later_s: float) -> None:
    """No Eq. 5 without it falls at all, so that every threshold gains without end."""
    speeds = np.geomspace(50, 900, 14)
    late_s = 0.03 + 0.01 * np.exp(-0.006 * speeds) + later_s * (speeds > 200)
    late_s += np.random.default_rng(1).normal(0, 3e-4, speeds.size)
    estimates = [
        SimpleNamespace(speed_mm_s=v, latency_s=s, curve_se_s=3e-4) for v, s in zip(speeds, late_s, strict=True)
    ]
    step = find_step(tuple(SimpleNamespace(estimate=one) for one in estimates))
    assert step is not None
    low, high = step.between_mm_s
    assert low < 200 < high
    assert step.size_s == pytest.approx(later_s, abs=1e-3)
    assert step.alone


@pytest.mark.parametrize("seed", range(6))
def test_a_constant_latency_shows_a_step_and_none_without_one(seed: int) -> None:
    """Exponentials fitted to it have amplitudes of either sign, of which Eq. 5 has none below zero."""
    speeds = np.geomspace(25, 400, 16)
    late_s = 0.034 + np.random.default_rng(seed).normal(0, 3e-4, speeds.size)
    for later_s in (0.012, 0.0):
        estimates = [
            SimpleNamespace(speed_mm_s=v, latency_s=s, curve_se_s=3e-4)
            for v, s in zip(speeds, late_s + later_s * (speeds > 106), strict=True)
        ]
        step = find_step(tuple(SimpleNamespace(estimate=one) for one in estimates))
        if later_s:
            assert step is not None
            assert step.size_s == pytest.approx(later_s, abs=1e-3)
            assert step.between_mm_s[0] < 106 < step.between_mm_s[1]
            assert step.alone
        else:
            assert step is None
