"""On a screen whose law is not Eq. 5, an effect is found, and law and gap are right with it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from draglag.gap import GapReport, close_gap
from draglag.gap.fitting.joint import fit_session
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.posterior.judge import likeliest, with_own_form
from draglag.gap.proposing.proposals import refits_with
from draglag.gap.replaying.replay import Replay, replays
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import Protocol, load_protocol
from draglag.recording import Session
from draglag.simulation import rig_for_screen, simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.second_filter_mode import SecondFilterMode
from draglag.simulation.law import LatencyLaw

MIDDLE_MM_S, STEEP = 200.0, 4.0


@dataclass(frozen=True)
class Logistic(LatencyLaw):
    """Latency that falls from one level to another about a speed."""

    def latency_s(self, speed_mm_s: ArrayLike) -> NDArray[np.float64]:
        fall = 1 / (1 + (np.asarray(speed_mm_s, float) / MIDDLE_MM_S) ** STEEP)
        return np.asarray(1e-3 * (self.a7_ms + self.a1_ms * fall))


LAW = Logistic(50.0, 0.0, 0.0, 0.0, 30.0)


@pytest.fixture(scope="module")
def circles() -> Protocol:
    demo = load_protocol("demo")
    runs = tuple(r.model_copy(update={"duration_s": 20.0}) for r in demo.runs if r.kind == "circle")
    return demo.model_copy(update={"runs": runs, "taps": None})


@pytest.fixture(scope="module")
def session(circles: Protocol) -> Session:
    rig = replace(rig_for_screen("screen-1"), law=LAW)
    return simulate_session(rig, circles, effects=[parse_effect("laser_hysteresis=0.0018")], seed=5)


@pytest.fixture(scope="module")
def report(session: Session) -> GapReport:
    return close_gap(session)


@pytest.fixture(scope="module")
def again(session: Session, report: GapReport) -> Replay:
    return replays(session, report)[-1]


def test_the_effect_is_named_and_the_law_said_to_be_of_another_form(report: GapReport) -> None:
    assert [step.effect for step in report.steps] == ["laser_hysteresis"]
    low, high = report.steps[0].parameters["delay_s"][1]
    assert low < 0.0018 < high
    assert not report.law.adequate


def test_the_gap_shrinks_to_the_noise_floor(report: GapReport) -> None:
    assert report.gap_last_mm is not None
    assert report.noise_floor_mm is not None
    assert report.gap_first_mm is not None
    floor2 = report.noise_floor_mm**2
    # A dozen held-out runs, each with an error of its own, know their mean square to sqrt(2 / 12), two fifths.
    assert report.gap_last_mm**2 < 1.4 * floor2
    assert report.gap_last_mm**2 - floor2 < 0.25 * (report.gap_first_mm**2 - floor2)


def test_the_law_fitted_with_the_effect_is_the_screens(report: GapReport) -> None:
    assert report.last is not None
    low, high = np.quantile(report.last.view.speed, [0.05, 0.95])
    speed = np.geomspace(low, high, 40)
    # 2 ms: a run's own latency of 0.3 ms and its speed's error of 1 % where the law falls by 0.25 ms per mm/s.
    np.testing.assert_allclose(report.last.law(speed), LAW.latency_s(speed), atol=2e-3)


def test_the_session_simulated_again_has_that_law(again: Replay) -> None:
    agree, of = again.runs_that_agree
    assert agree >= of - 1


@dataclass(frozen=True)
class Resonant(LatencyLaw):
    """A latency that is larger about one speed: no law of a panel is so narrow."""

    def latency_s(self, speed_mm_s: ArrayLike) -> NDArray[np.float64]:
        speed = np.asarray(speed_mm_s, float)
        about = np.exp(-0.5 * ((speed - 120.0) / 15.0) ** 2)
        return np.asarray(0.03 + 0.05 * np.exp(-speed / 80.0) + 1e-3 * self.a1_ms * about)


@pytest.mark.parametrize(("size_ms", "verdict"), [(0.0, ("no_gap", None)), (6.0, ("unexplained", "speed"))])
def test_a_latency_about_one_speed_is_no_scatter_of_runs(
    circles: Protocol, size_ms: float, verdict: tuple[str, str | None]
) -> None:
    rig = replace(rig_for_screen("screen-1"), law=Resonant(size_ms, 0.0, 0.0, 0.0, 30.0))
    report = close_gap(simulate_session(rig, circles, seed=5), candidates=("clock_drift",))
    assert (report.verdict, report.unexplained_by) == verdict


def test_a_step_is_sought_next_to_the_curves_own_form(circles: Protocol) -> None:
    rig = replace(rig_for_screen("screen-1"), law=LAW)
    session = simulate_session(rig, circles, effects=[SecondFilterMode(0.012, 550.0)], seed=5)
    first = fit_session(session, gather(session))
    own = with_own_form(session, first)
    fit = likeliest(refits_with(session, own, "second_filter_mode", ()), own, "second_filter_mode")
    assert fit is not None
    low_s, high_s = parameters_of("second_filter_mode", fit)["extra_s"][1]
    assert fit.law.remainder_s  # Eq. 5 alone bends about the fall of this law, and takes the step for 8 ms more
    assert low_s < 0.012 < high_s
