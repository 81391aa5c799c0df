"""A law that follows the speed of another moment, far from those that are tried first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from draglag.gap import close_gap
from draglag.protocol.runs import load_protocol
from draglag.recording import Session
from draglag.simulation import rig_for_screen, simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.lagging_law.refits import step_s
from draglag.simulation.law import LatencyLaw

LATER_S = 0.12


@pytest.fixture(scope="module")
def session() -> Session:
    """Ten circles and three chirps on a panel whose law follows a speed 0.12 s later than the edge's."""
    demo = load_protocol("demo")
    circle, chirp = (next(run for run in demo.runs if run.kind == kind) for kind in ("circle", "chirp"))
    speeds = tuple(map(float, np.geomspace(45.0, 900.0, 10).round()))
    chirps = [chirp.model_copy(update={"duration_s": length_s}) for length_s in (30.0, 25.0, 35.0)]
    runs = (circle.model_copy(update={"speeds_mm_s": speeds, "duration_s": 20.0}), *chirps)
    rig = replace(rig_for_screen("screen-1"), law=LatencyLaw(49.0, 0.0036, 170.0, 0.0228, 28.4))
    protocol = demo.model_copy(update={"runs": runs, "taps": None})
    return simulate_session(rig, protocol, effects=[parse_effect(f"lagging_law={-LATER_S}")], seed=1)


def test_a_law_of_a_much_later_speed_is_named_with_its_delay(session: Session) -> None:
    (step,) = close_gap(session).steps
    assert step.effect == "lagging_law"
    _, (low, high) = step.parameters["delay_s"]
    assert low < -LATER_S < high < 0


def test_the_next_delay_lies_between_two_that_miss_on_either_side() -> None:
    assert step_s([(0.05, 0.02)]) == pytest.approx(0.02)
    assert step_s([(0.05, 0.02), (0.07, 0.01)]) == pytest.approx(0.01)
    # At −0.12 s 0.05 are left, at −0.07 s −0.05: nothing in the middle.
    assert -0.07 + step_s([(-0.12, 0.05), (-0.07, -0.05)]) == pytest.approx(-0.095)
