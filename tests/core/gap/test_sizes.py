"""By how much a fitted effect moves the edges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from core import sound_sessions
from draglag.exchange import read_exchange
from draglag.gap.fitting.heldout import gap_mm
from draglag.gap.fitting.jackknife import jackknife_sd
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.fitting.parameters import whole_size_mm
from draglag.gap.fitting.state import Term
from draglag.gap.posterior import answer
from draglag.gap.posterior.pool import compared
from draglag.gap.proposing.proposals import refits_with
from draglag.gap.traces.run_data import gather
from draglag.recording import TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.second_filter_mode.setting import By, Setting

ABOVE_MM_S = 200.0
SAMPLES = Path(__file__).parents[2] / "data" / "exchange"


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


def test_what_moves_few_edges_but_shrinks_the_gap_is_of_interest(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ripple on slow runs alone makes all edges count for less: 0.03 mm over all, for a gap of 0.28 mm."""
    session = read_exchange(SAMPLES / "none-A")

    def rippled(touch: TouchTrace) -> TouchTrace:
        return replace(touch, y_mm=touch.y_mm + 0.47 * np.sin(2 * np.pi * touch.y_mm / 6.96))

    session = replace(session, runs=tuple(replace(run, touch=rippled(run.touch)) for run in session.runs))
    first = fit_session(session, gather(session))
    (fit,) = refits_with(session, first, "pitch_ripple", ())
    assert fit is not None
    pool = compared([first, fit], ["pitch_ripple"], False)
    monkeypatch.setattr(answer, "whole_size_mm", lambda fit, name: 0.03)
    assert gap_mm(first) - gap_mm(fit) > 0.05
    assert answer.answer_of(pool).effects == ("pitch_ripple",)
    monkeypatch.setattr(answer, "_shrinks_by_mm", lambda pool, fit, name: 0.0)
    assert answer.answer_of(pool).effects == ()


def test_a_run_that_knows_most_of_a_size_does_not_widen_its_interval() -> None:
    """One number, of which one run of twelve has two thirds of the information."""
    rng = np.random.default_rng(1)
    run = np.repeat(np.arange(12), 20)
    design = np.where(run == 0, 1.0, np.sqrt(0.5 / 11))[:, None]
    variance = 1 / float(np.sum(design**2))
    white = SimpleNamespace(apply=lambda columns: columns)
    squares = []
    for _ in range(1000):
        residual = rng.standard_normal(run.size)
        fit = SimpleNamespace(white=white, design=design, residual_mm=residual, prior=np.zeros(1), run_index=run)
        squares.append(jackknife_sd(cast("Fit", fit))[0] ** 2)
    # A square of about two degrees of freedom varies by its mean: of a thousand the mean by 3 %.
    assert np.mean(squares) == pytest.approx(variance, rel=0.12)
