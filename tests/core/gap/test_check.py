"""What the session simulated again disagrees with, and what lies below the size of interest."""

from __future__ import annotations

import pytest

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
