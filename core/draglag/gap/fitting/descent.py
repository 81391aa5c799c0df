"""Damped Gauss–Newton search of the joint fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.fitting.likelihood import downhill, likeliest
from draglag.gap.fitting.noise import Components, scatter
from draglag.gap.fitting.search import at_best_rates, cost_relative_to
from draglag.gap.fitting.state import State, stepped, usable
from draglag.gap.fitting.whitening import Whitener, whitener
from draglag.gap.traces.run_data import RunData
from draglag.messages import message
from draglag.recording import Session

# Of a run's own latency and offset while the law is sought. Physical: panels' scatter between runs.
MOST_RUN_S, MOST_RUN_MM = 1e-3, 0.03
UNUSABLE = message("Check the calibration and the clocks of this session")
STEPS, ATTEMPTS = 20, 4  # of a search, and at one step. Derived: cost
LEAST_DAMPING = 1e-5  # of the information's diagonal: the valley of two exponentials is 100 times narrower. Derived
STRONGER, WEAKER = 100.0, 10.0  # factors of the damping after a step that failed, and after one that did not. Derived
IDLE = 3  # damped steps in a row that gain less than ENOUGH move by the rounding of the placing. Derived
PLACING = 0.1  # of the cost: placing an edge is exact to a few µm only. Derived
ROUGHLY, ENOUGH = 0.5, 0.05  # nats that a step may promise before edges are judged, and in the end. Derived: below one


@dataclass(frozen=True)
class Search:
    """Parameters, mask of used edges, noise."""

    state: State
    use: np.ndarray
    components: Components
    white: Whitener

    @classmethod
    def at(cls, runs: tuple[RunData, ...], state: State, use: np.ndarray, components: Components) -> Search:
        return cls(state, use, components, whitener(scatter(runs, state.placed, use, state.blur_mm), components))

    def moved(self, runs: tuple[RunData, ...], state: State, strayed: np.ndarray) -> Search:
        """At another point, without the edges that cannot be placed there."""
        return (
            Search.at(runs, state, self.use & ~strayed, self.components)
            if strayed.any()
            else replace(self, state=state)
        )

    def at_best_rates(self, runs: tuple[RunData, ...], width_mm: float) -> Search:
        """At the likeliest rates of a grid, if better."""
        state, use = at_best_rates(self.state, self.white, self.use, runs, width_mm)
        return self if state is self.state else Search.at(runs, state, use, self.components)


def descended(session: Session, runs: tuple[RunData, ...], search: Search, fixed: bool) -> Search:
    """Converged search. fixed: edges of a smaller model. Edges and weights follow the law only at first."""
    width_mm = session.screen.width_mm
    settled = judged = False
    damping, idle = 0.0, 0
    for iteration in range(STEPS):
        if iteration == 1:
            search = search.at_best_rates(runs, width_mm)
        if (iteration == 4 and not judged) or settled:
            settled, judged, damping = False, True, 0.0
            search = _judged(session, runs, search, fixed).at_best_rates(runs, width_mm)
        found = _next(search.state, search.white, search.use, runs, width_mm, damping, ENOUGH if judged else ROUGHLY)
        settled = found is None
        if found is None:
            if judged:
                break
            continue
        state, strayed, gained, damping = found
        if not fixed and not judged:
            search = Search.at(runs, state, usable(state, runs, loose=iteration < 2), search.components)
        else:
            search = search.moved(runs, state, strayed)
        # A damped step may gain little where much is left to gain; several in a row do not.
        free = damping == 0
        idle = idle + 1 if gained < ENOUGH else 0
        if judged and idle >= (1 if free else IDLE):
            break
        settled = not judged and free and gained < ROUGHLY and iteration >= 2
    return search


def lowered(runs: tuple[RunData, ...], search: Search, width_mm: float) -> Search:
    """Search converged under its weights; the same object if no step promises anything."""
    damping = 0.0
    for _ in range(STEPS):
        found = _next(search.state, search.white, search.use, runs, width_mm, damping, ENOUGH)
        if found is None:
            break
        state, strayed, gained, damping = found
        search = search.moved(runs, state, strayed)
        if gained < ENOUGH:
            break
    return search


def _judged(session: Session, runs: tuple[RunData, ...], search: Search, fixed: bool) -> Search:
    state = search.state
    use = search.use & (state.placed.ok if fixed else usable(state, runs, loose=False))
    if not use.any():
        raise EstimateError(
            message("{session}: no edge lies where the law predicts it", session=session.name), UNUSABLE
        )
    parts = scatter(runs, state.placed, use, state.blur_mm)
    # A run's own latency is kept small here, or the law would be free to leave a gap instead of closing it.
    likely = likeliest(parts, state.residual[use], state.design[use], state.prior, (search.components,), rounds=1)
    components = replace(likely, run_s=min(likely.run_s, MOST_RUN_S), run_mm=min(likely.run_mm, MOST_RUN_MM))
    return Search(state, use, components, whitener(parts, components))


def _next(
    state: State,
    white: Whitener,
    use: np.ndarray,
    runs: tuple[RunData, ...],
    width_mm: float,
    damping: float,
    least: float,
) -> tuple[State, np.ndarray, float, float] | None:
    """Lower point, edges that cannot be placed there, fall of the cost, next damping; None at the end."""
    down = downhill(white, state, use)
    if down.step(0.0)[1] < least:
        return None
    for attempt in range(ATTEMPTS):
        step, _ = down.step(damping)
        there = stepped(state, step, runs, width_mm)
        cost, strayed = cost_relative_to(white, there, state, use)
        if cost <= down.cost + PLACING:
            if attempt == 0:
                damping = damping / WEAKER if damping > LEAST_DAMPING else 0.0
            return there, strayed, down.cost - cost, damping
        damping = max(STRONGER * damping, LEAST_DAMPING)
    return None
