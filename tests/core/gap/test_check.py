"""What the session simulated again disagrees with, and what lies below the size of interest."""

from __future__ import annotations

import pytest

from core import sound_sessions
from draglag.gap import close_gap
from draglag.gap.check import compared_statistics
from draglag.gap.replaying.replay import replay
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect


@pytest.mark.parametrize(("more_mm", "agrees"), [(0.06, True), (-0.06, True), (0.14, False), (-0.14, False)])
def test_a_width_disagrees_where_it_moves_edges_by_the_size_of_interest(more_mm: float, agrees: bool) -> None:
    """0.05 mm of an edge are 0.1 mm of a width; its mean over the runs is known to 0.01 mm."""
    shadow = parse_effect(f"beam_width={more_mm}")
    session = simulate_session("screen-1", load_protocol("demo"), effects=[shadow], seed=5)
    last = close_gap(session, max_effects=0).last
    assert last is not None
    found = {one.name: one for one in compared_statistics(session, replay(session, last, {}))}
    width = found["stylus width"]
    assert width.agrees is agrees
    assert width.measured - width.simulated == pytest.approx(more_mm, abs=0.04)


def test_a_loop_s_phase_is_no_disagreement() -> None:
    """Frames and loop beat slowly, from a phase that no simulation knows: runs are late by up to 14 ms more."""
    loop = parse_effect("sample_hold=70")
    session = simulate_session("screen-1", sound_sessions.brief_protocol(), effects=[loop], seed=5)
    report = close_gap(session)
    assert [step.effect for step in report.steps] == ["sample_hold"]
    assert report.verdict == "explained"
    found = {one.name: one for one in report.check}
    assert found["latency by run"].measured > 0.5
    assert all(one.agrees for one in report.check)
