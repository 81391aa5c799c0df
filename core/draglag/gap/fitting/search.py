"""Cost of a point, and the best law near it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.fitting.law_form import FlexibleLaw
from draglag.gap.fitting.likelihood import cost_without_nuisances
from draglag.gap.fitting.rates import best_rates
from draglag.gap.fitting.state import State, stepped
from draglag.gap.fitting.whitening import Whitener
from draglag.gap.traces.run_data import RunData

MAY_STRAY = 0.1  # of the edges: more, and a step has left the session. Judgement


def cost_relative_to(white: Whitener, state: State, before: State, use: np.ndarray) -> tuple[float, np.ndarray]:
    """Cost of a state, ∞ if many edges cannot be placed; mask of those, which keep their earlier cost."""
    strayed = use & ~(state.placed.ok & np.isfinite(state.residual))
    if np.count_nonzero(strayed) > MAY_STRAY * np.count_nonzero(use):
        return np.inf, strayed
    if strayed.any():
        residual = np.where(strayed, before.residual, state.residual)
        state = replace(state, residual=residual, design=np.where(strayed[:, None], before.design, state.design))
    return cost_without_nuisances(white, state, use), strayed


def at_best_rates(
    state: State, white: Whitener, use: np.ndarray, runs: tuple[RunData, ...], width: float
) -> tuple[State, np.ndarray]:
    """State and edges at the best rates, if likelier; unchanged for a ``FlexibleLaw``."""
    if isinstance(state.law, FlexibleLaw):
        return state, use
    found = best_rates(state, white, use)
    if found is None:
        return state, use
    there = stepped(state, found[1], runs, width, found[0])
    cost, strayed = cost_relative_to(white, there, state, use)
    return (there, use & ~strayed) if cost < cost_without_nuisances(white, state, use) else (state, use)
