"""The verdict does not depend on how a session is written down, and a larger model never fits worse."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from draglag.exchange.importers.columns import laser_of, touch_of
from draglag.gap import GapReport, close_gap
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.steps import deviance_gained
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.recording import Run, Session
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect

PLACING = 4.0  # of the deviance: placing an edge again is exact to a few µm only
LATER_S = 5000.0


@pytest.fixture(scope="module")
def session() -> Session:
    demo = load_protocol("demo")
    runs = tuple(r.model_copy(update={"duration_s": 15.0}) for r in demo.runs if r.kind == "circle")
    protocol = demo.model_copy(update={"runs": runs, "taps": None})
    return simulate_session("screen-1", protocol, effects=[parse_effect("laser_hysteresis=0.0018")], seed=3)


@pytest.fixture(scope="module")
def report(session: Session) -> GapReport:
    found = close_gap(session)
    assert [step.effect for step in found.steps] == ["laser_hysteresis"]
    return found


def permuted(session: Session) -> Session:
    return replace(session, runs=session.runs[::-1])


def mirrored(session: Session) -> Session:
    """Left to right."""
    width_mm = session.screen.width_mm
    runs = (replace(run, touch=replace(run.touch, x_mm=width_mm - run.touch.x_mm)) for run in session.runs)
    return replace(session, runs=tuple(runs))


def later(session: Session) -> Session:
    """On a clock that began earlier."""
    return replace(
        session,
        runs=tuple(
            replace(
                run,
                touch=replace(run.touch, t_s=run.touch.t_s + LATER_S),
                laser=replace(run.laser, t_s=run.laser.t_s + LATER_S),
                start_s=run.start_s + LATER_S,
            )
            for run in session.runs
        ),
    )


def in_other_units(session: Session) -> Session:
    """In milliseconds, microseconds and inches, read back as an import does."""
    units = {"t": "ms", "x": "in", "y": "in"}

    def read_back(run: Run) -> Run:
        columns = {"t": 1e3 * run.touch.t_s, "x": run.touch.x_mm / 25.4, "y": run.touch.y_mm / 25.4}
        touch = touch_of(columns, units, run.id, None, None)
        return replace(run, touch=touch, laser=laser_of(1e6 * run.laser.t_s, run.laser.light, "us", "1", run.id))

    return replace(session, runs=tuple(map(read_back, session.runs)))


@pytest.mark.parametrize("change", [permuted, mirrored, later, in_other_units])
def test_the_way_a_session_is_written_down_changes_no_verdict(
    session: Session, report: GapReport, change: Callable[[Session], Session]
) -> None:
    other = close_gap(change(session))
    assert (other.verdict, [step.effect for step in other.steps]) == (report.verdict, ["laser_hysteresis"])
    value, (low, high) = report.steps[0].parameters["delay_s"]
    assert other.steps[0].parameters["delay_s"][0] == pytest.approx(value, abs=0.2 * (high - low))
    assert other.gap_last_mm == pytest.approx(report.gap_last_mm, rel=0.1)


@pytest.fixture(scope="module")
def fitted(session: Session) -> Fit:
    return fit_session(session, gather(session))


@pytest.mark.parametrize("effect", ["laser_hysteresis", "beam_width", "scan_skew", "clock_drift"])
def test_a_refit_with_one_more_effect_never_fits_worse(session: Session, fitted: Fit, effect: str) -> None:
    """So it never loses more evidence than its Occam factor, which is of the prior alone."""
    larger = refit(session, fitted, [Term(effect)])
    assert larger is not None
    assert deviance_gained(fitted, larger) > -PLACING
