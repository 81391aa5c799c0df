"""A second filter above a speed that no run crosses: Eq. 5 bends until it nearly hides the step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from draglag.gap import close_gap
from draglag.protocol.runs import load_protocol
from draglag.recording import FloatArray, IntArray, Session
from draglag.simulation import rig_for_screen, simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.second_filter_mode.setting import By, Setting
from draglag.simulation.effects.second_filter_mode.unsure import near_switch
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
        (120.0, 1),  # the runs' scatter explained it: no gap
        (300.0, 1),  # edges about a threshold between two runs were left open, and these runs with them
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


@dataclass(frozen=True)
class Edges:
    """Edges of runs, as far as a threshold of speed is about."""

    run: IntArray
    speed_mm_s: FloatArray
    accel_apart_mm_s2: FloatArray
    speed_half_s: FloatArray


def test_a_run_on_one_side_of_a_threshold_is_unsure_only_next_to_it() -> None:
    """Only where a run's positions jump, as they do at a switch, are speeds read wrong by the jump."""
    speed = np.array([220.0, 230.0, 240.0, 250.0, 251.0, 330.0, 320.0, 310.0, 280.0, 250.0])
    run = np.repeat([0, 1], 5)
    edges = Edges(run, speed, np.zeros(10), np.full(10, 0.25))
    unsure = near_switch(edges, Setting(260.0, By.SPEED), 0.02)  # type: ignore[arg-type]
    # The jump is 0.02 s of 280 mm/s over half a window of 0.25 s, 22 mm/s, next to 12 that no speed is known to.
    assert unsure.tolist() == [0, 0, 0, 1, 1, 0, 0, 0, 1, 1]
