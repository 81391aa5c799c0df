"""Strokes back and forth: one speed where they cross the beam, another everywhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from draglag.gap import close_gap
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.recording import Run, Session
from draglag.simulation import LatencyLaw, rig_for_screen, simulate_run_with_truth, simulate_session
from draglag.simulation.effects.sample_hold.stream import hold
from draglag.simulation.kinematics import GRID_HZ, Motion
from draglag.simulation.rig import Rig

RIG = replace(rig_for_screen("screen-1"), noise_mm=0.04)  # quiet, so that a wrong speed shows
PEAKS_MM_S = (60.0, 90.0, 130.0, 180.0, 250.0, 350.0, 450.0, 550.0)
HALF_WAY_MM = 60.0
OFF_MIDDLE = 0.45  # of half the way: there the speed is 0.89 of its peak, and changes


def stroked(rig: Rig, peak_mm_s: float, start_s: float, seed: int) -> Run:
    """Thirty strokes, at the pace of a sine, across the beam off their middle, while they move along the panel."""
    turn_s = HALF_WAY_MM / peak_mm_s
    t_s = np.arange(0.0, 30 * np.pi * turn_s, 1 / GRID_HZ)
    along_mm_s = 0.4 * rig.screen.width_mm / t_s[-1]
    x_mm = 0.3 * rig.screen.width_mm + along_mm_s * t_s
    middle_mm = rig.beam.slope * x_mm + rig.beam.intercept_mm + OFF_MIDDLE * HALF_WAY_MM
    y_mm = middle_mm - HALF_WAY_MM * np.cos(t_s / turn_s)
    vy_mm_s = rig.beam.slope * along_mm_s + peak_mm_s * np.sin(t_s / turn_s)
    motion = Motion(t_s, x_mm, y_mm, np.full(t_s.size, along_mm_s), vy_mm_s, np.ones(t_s.size, bool))
    rng = np.random.default_rng([seed, round(peak_mm_s)])
    run_id = f"stroke-{peak_mm_s:.0f}"
    return simulate_run_with_truth(rig, motion, run_id=run_id, planned=None, start_s=start_s, rng=rng)[0]


@pytest.fixture(scope="module", params=[1, 2])
def session(request: pytest.FixtureRequest) -> Session:
    circles = simulate_session(RIG, load_protocol("demo"), seed=request.param)
    begin_s = 60.0 + max(run.touch.t_s[-1] for run in circles.runs)
    strokes = [stroked(RIG, v, begin_s + 120.0 * k, request.param) for k, v in enumerate(PEAKS_MM_S)]
    return replace(circles, runs=(*circles.runs, *strokes))


def test_what_a_steep_law_skips_at_the_turns_is_no_age_of_positions() -> None:
    """The frames of this panel lie as evenly as the ticks of a loop would."""
    steep = LatencyLaw(60.0, 0.004, 300.0, 0.03, 20.0)
    rig = replace(RIG, law=steep, touch_rate_hz=360.0, scan_jitter_s=0.0, contact_loss_per_s=0.0, noise_mm=0.08)
    touches = [stroked(rig, v, 0.0, 1).touch for v in (120.0, 160.0, 250.0, 450.0)]
    assert hold(touches) is None


def test_a_session_of_strokes_alone_has_a_verdict(session: Session) -> None:
    """No run keeps one speed: none of those that decide on a law that follows the speed late."""
    alone = replace(session, runs=tuple(run for run in session.runs if run.id.startswith("stroke")))
    assert close_gap(alone).verdict == "no_gap"


def test_strokes_have_no_speed_of_their_own(session: Session) -> None:
    each = {data.run.id: data.steady for data in gather(session)}
    assert not any(steady for name, steady in each.items() if name.startswith("stroke"))
    assert sum(each.values()) >= 8  # the circles


def test_strokes_off_their_middle_are_no_gap(session: Session) -> None:
    report = close_gap(session)
    assert report.verdict == "no_gap"
    assert report.last is not None
    shown = {report.last.runs[k].run.id for k in np.unique(report.last.run_index)}
    assert len([name for name in shown if name.startswith("stroke")]) >= 4  # the others turn next to the beam
