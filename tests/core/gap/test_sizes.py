"""By how much a fitted effect moves the edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core import sound_sessions
from draglag.gap.fitting.joint import fit_session
from draglag.gap.fitting.parameters import whole_size_mm
from draglag.gap.fitting.state import Term
from draglag.gap.traces.run_data import gather
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.second_filter_mode.setting import By, Setting

ABOVE_MM_S = 200.0


def test_an_effect_is_no_smaller_where_its_edges_are_left_open() -> None:
    """Edges next to the switches of a filter may be all that it moves: it counts although none of them is used."""
    effects = [parse_effect(f"second_filter_mode=0.01,threshold_mm_s={ABOVE_MM_S}")]
    session = simulate_session("screen-1", sound_sessions.brief_protocol(), effects=effects, seed=5)
    mode = Term("second_filter_mode", Setting(ABOVE_MM_S, By.SPEED).theta)
    fit = fit_session(session, gather(session), [mode])
    slow = fit.view.speed < ABOVE_MM_S
    use = fit.use.copy()
    use[fit.use] = slow
    size_mm = whole_size_mm(replace(fit, use=use, design=fit.design[slow]), "second_filter_mode")
    moved_mm = 0.01 * fit.view.v_across * fit.view.stretch * ~slow
    assert size_mm == pytest.approx(np.sqrt(np.mean(moved_mm**2)), rel=0.1)
    assert whole_size_mm(fit, "scan_skew") is None
