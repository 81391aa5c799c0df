"""A law of the size of a mean velocity, which is less where the path turns."""

from __future__ import annotations

import numpy as np

from draglag.gap.fitting.joint import fit_session
from draglag.gap.fitting.model import base_columns
from draglag.gap.traces.edges import TRACKED_S
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session

WINDOW_S = 0.003  # so short that the speed lost, a thousandth, counts to first order


def test_a_column_is_the_displacement_of_edges_by_the_speed_lost() -> None:
    """A mean over a window of σ turns by ω: its size is smaller by exp(−½ ω² σ²), and the law later by as much."""
    session = simulate_session("screen-1", load_protocol("demo"), seed=4)
    fit = fit_session(session, gather(session))
    placed = fit.placed
    turned = base_columns(placed, fit.law)[:, -2]
    steady = placed.ok & placed.steady
    assert np.all(turned[placed.ok & ~placed.steady] == 0)
    lost = np.exp(-0.5 * (WINDOW_S * placed.turn_rad_s) ** 2)
    later_s = fit.law(placed.speed_mm_s * lost) - fit.law(placed.speed_mm_s)
    moved_mm = placed.v_mm_s[:, 1] * placed.stretch * later_s
    fast = steady & (np.abs(moved_mm) > 2e-4)
    assert np.count_nonzero(fast) > 100
    np.testing.assert_allclose(turned[fast] * (WINDOW_S / TRACKED_S) ** 2, moved_mm[fast], rtol=0.01)
    assert np.all(later_s[steady] >= 0)
