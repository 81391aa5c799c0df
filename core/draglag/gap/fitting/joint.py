"""The joint fit: curve, beam and all accepted effects, by Gauss–Newton under the session's own noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.fitting.likelihood import cost_without_nuisances, downhill, likeliest, likelihoods, profile
from draglag.gap.fitting.model import Geometry, LawParameters, base_prior, starting_law
from draglag.gap.fitting.noise import BETWEEN, EDGE_MM, SPEED, Components, Scatter, scatter
from draglag.gap.fitting.search import at_best_rates, cost_relative_to
from draglag.gap.fitting.state import State, Term, linearise, stepped, term_signature, usable
from draglag.gap.fitting.whitening import Whitener, whitener
from draglag.gap.traces.dewarped import DewarpedKinematics
from draglag.gap.traces.edges import Placed
from draglag.gap.traces.run_data import RunData, undone
from draglag.recording import FloatArray, Session
from draglag.simulation.effects import EFFECTS, effect_class
from draglag.simulation.residual import Averaged, View

HELD = 1e9  # precision
STEPS, ATTEMPTS = 12, 6
PLACING = 0.1  # of the cost: placing an edge is exact to a few µm only
ROUGHLY, ENOUGH = 0.5, 0.05  # what a step may still promise before the edges are judged, and in the end
START = Components(0.05, 0.01, 1.0, 0.1, 0.0003, 0.03)


@dataclass(frozen=True)
class Fit:
    """A converged joint fit.

    Attributes (m used edges): use: mask over placed; residual_mm; design (m, p): columns that explain residuals, base
    then terms; view: restricted to the used edges; whiteners: one a grid point; best: index of the likeliest; only:
    mask over placed of the edges that the fit was to judge by, None for all.
    """

    runs: tuple[RunData, ...]
    placed: Placed
    use: np.ndarray
    law: LawParameters
    geometry: Geometry
    terms: tuple[Term, ...]
    residual_mm: FloatArray
    design: FloatArray
    prior: FloatArray
    covariance: FloatArray
    view: View
    whiteners: tuple[Whitener, ...]
    best: int
    log_likelihood: float
    width_mm: float
    blur_mm: FloatArray
    only: np.ndarray | None = None

    @property
    def run_index(self) -> np.ndarray:
        return np.asarray(self.placed.run[self.use])


def effects_in(fit: Fit) -> tuple[str, ...]:
    """Ids of the effects in a fit, sorted: its terms, and those of its law."""
    named = [term.effect for term in fit.terms if term.effect in EFFECTS]
    return tuple(sorted([*named, *effects_in_law(fit)]))


def effects_in_law(fit: Fit) -> tuple[str, ...]:
    """Ids of the effects that a fit holds in its law."""
    return tuple(name for name, effect in EFFECTS.items() if effect.in_law(fit.law))


def restrict(view: View, use: np.ndarray) -> View:
    arrays: dict[str, Any] = {
        k: v[use] for k, v in view.__dict__.items() if isinstance(v, np.ndarray | Averaged | DewarpedKinematics)
    }
    return replace(view, **arrays)


def fit_session(
    session: Session,
    runs: tuple[RunData, ...],
    terms: Sequence[Term] = (),
    plateau: bool = False,
    start: Fit | None = None,
    law: LawParameters | None = None,
    only: np.ndarray | None = None,
) -> Fit:
    """Fit law, beam and terms jointly.

    ``start`` is a fit of a smaller model: its edges are judged by, so that the two can be compared, and it sizes the
    new terms. ``law`` is where to begin instead of the runs' own latencies. ``only``: of all edges, those to judge by.

    Raises EstimateError when the session cannot carry the law.
    """
    width = session.screen.width_mm
    runs, terms = _on_their_traces(runs, terms)
    less = None
    sizes: list[tuple[float, ...]] = [() for _ in terms]
    if start is not None and terms:
        less, sizes = _first_sizes(start, terms)
    laws = [law] if law is not None and (law.plateau_mm_s > 0) == plateau else [starting_law(runs, less, plateau)]
    if law is None and start is not None and (start.law.plateau_mm_s > 0) == plateau:
        laws.append(start.law)
    slopes = [(d.estimate.alignment.slope, d.estimate.alignment) for d in runs if d.estimate and d.estimate.alignment]
    slope = float(np.median([s for s, _ in slopes]))
    middle = float(np.median([0.5 * (a.intercept_top_mm + a.intercept_bottom_mm) for _, a in slopes]))
    geometry = Geometry(slope, middle, session.stylus.diameter_mm)
    placed: Placed | None = None
    active = [replace(t, sizes=t.sizes or q) for t, q in zip(terms, sizes, strict=True)]
    components = START
    states = []
    for begin in laws:
        state = linearise(runs, begin, geometry, active, width, None)
        if any(t.sizes for t in active):
            state = linearise(runs, begin, geometry, state.terms, width, state)
        states.append(state)
    use = usable(states[0], runs, loose=True) if start is None else start.use.copy()
    if start is not None and start.only is not None:  # what the smaller model could not judge by, this one cannot
        only = start.only if only is None else only & start.only
    use = use if only is None else use & only
    state = states[0]
    if not use.any():
        raise EstimateError(f"{session.name}: no edge can be placed on the trace", "Begin from another law")
    settled = judged = False
    damping = 0.0
    white = whitener(scatter(runs, state.placed, use, state.blur_mm), components)
    if len(states) > 1:
        other_cost, strayed = cost_relative_to(white, states[1], state, use)
        if other_cost < cost_without_nuisances(white, state, use):
            state, use = states[1], use & ~strayed
            white = whitener(scatter(runs, state.placed, use, state.blur_mm), components)
    for iteration in range(STEPS):
        if iteration == 1:
            better, fewer = at_best_rates(state, white, use, runs, width)
            if better is not state:
                state, use = better, fewer
                white = whitener(scatter(runs, state.placed, use, state.blur_mm), components)
        if (iteration == 4 and not judged) or settled:
            settled, judged, damping = False, True, 0.0
            use = use & usable(state, runs, loose=False) if start is None else use & state.placed.ok
            if not use.any():
                raise EstimateError(
                    f"{session.name}: no edge lies where the law predicts it",
                    "Check the calibration and the clocks of this session",
                )
            parts = scatter(runs, state.placed, use, state.blur_mm)
            # A run's own latency is kept small here, or the law would be free to leave a gap instead of closing it.
            likely = likeliest(parts, state.residual[use], state.design[use], state.prior, (components,), rounds=1)
            components = replace(likely, run_s=min(likely.run_s, 1e-3), run_mm=min(likely.run_mm, 0.03))
            white = whitener(parts, components)
            better, fewer = at_best_rates(state, white, use, runs, width)
            if better is not state:
                state, use = better, fewer
                white = whitener(scatter(runs, state.placed, use, state.blur_mm), components)
        found = _next(state, white, use, runs, width, damping, ENOUGH if judged else ROUGHLY)
        if found is None and judged:
            break
        settled = found is None
        if found is None:
            continue
        state, strayed, gained, damping = found
        if strayed.any():
            use = use & ~strayed
            white = whitener(scatter(runs, state.placed, use, state.blur_mm), components)
        # Edges and weights follow the law, but not to the end: or the search would chase them.
        if start is None and not judged:
            use = usable(state, runs, loose=iteration < 2)
            white = whitener(scatter(runs, state.placed, use, state.blur_mm), components)
        if judged and gained < ENOUGH:
            break
        settled = not judged and gained < ROUGHLY and iteration >= 2
    placed, view, law, geometry, active = state.placed, state.view, state.law, state.geometry, list(state.terms)
    use = use & (usable(state, runs, loose=False) if start is None else placed.ok)
    parts = scatter(runs, placed, use, state.blur_mm)
    far = replace(components, edge_mm=EDGE_MM[0], speed=SPEED[-1])
    begun = [components, far]
    if start is not None:
        begun.append(start.whiteners[start.best].components)  # or the larger model may seem the less likely one
    components = likeliest(parts, state.residual[use], state.design[use], state.prior, begun)
    residual, design, prior = state.residual, state.design, state.prior
    whiteners = tuple(whitener(parts, replace(components, run_s=a, run_mm=b)) for a, b in BETWEEN)
    prior = state.prior.copy()
    prior[: base_prior(law).size] = base_prior(law)
    prior[: law.at_bounds.size][law.at_bounds] = HELD  # what cannot move further must not be credited for it
    value = likelihoods(parts, residual[use], design[use], prior)
    values = [value(w.components) for w in whiteners]
    best = int(np.argmax(values))
    _, spread = profile(whiteners[best], residual[use], design[use], prior)
    return Fit(
        runs,
        placed,
        use,
        law,
        geometry,
        tuple(active),
        residual[use],
        design[use],
        prior,
        spread,
        restrict(view, use),
        whiteners,
        best,
        float(values[best]),
        width,
        state.blur_mm,
        only,
    )


def _next(
    state: State,
    white: Whitener,
    use: np.ndarray,
    runs: tuple[RunData, ...],
    width_mm: float,
    damping: float,
    least: float,
) -> tuple[State, np.ndarray, float, float] | None:
    """A point further down, which edges cannot be placed there, by how much the cost fell and the damping to go on with
    (Levenberg–Marquardt: Eq. 5's amplitudes and rates lie in a valley that plain steps leave). None where no step
    promises at least that much, or goes down at all."""
    down = downhill(white, state, use)
    for attempt in range(ATTEMPTS):
        step, promised = down.step(state.prior, damping)
        if promised < least:
            return None
        there = stepped(state, step, runs, width_mm)
        cost, strayed = cost_relative_to(white, there, state, use)
        if cost <= down.cost + PLACING:
            if attempt == 0:
                damping = damping / 10 if damping > 1e-5 else 0.0
            return there, strayed, down.cost - cost, damping
        damping = max(10 * damping, 1e-3)
    return None


def _on_their_traces(runs: tuple[RunData, ...], terms: Sequence[Term]) -> tuple[tuple[RunData, ...], Sequence[Term]]:
    """Traces with the terms' displacement removed, and the terms: each keeps what is left of it."""
    each = [effect_class(term.effect).undoing(term, runs) for term in terms]
    ready = undone(runs, [what for what, _ in each if what is not None])
    return ready, [left for _, left in each]


def most_promising(before: Fit, options: Sequence[Sequence[Term]], law: LawParameters) -> Sequence[Term]:
    """Of several sets of sized terms added to a law, the one that the edges of ``before`` fit best, unrefined."""
    values: list[float] = []
    for terms in options:
        state = linearise(before.runs, law, before.geometry, terms, before.width_mm, None)
        state = linearise(before.runs, law, before.geometry, state.terms, before.width_mm, state)
        use = before.use & state.placed.ok & np.isfinite(state.residual)
        white = whitener(scatter(before.runs, state.placed, use, state.blur_mm), START)
        value, _ = profile(white, state.residual[use], state.design[use], state.prior)
        values.append(value / max(int(use.sum()), 1))
    return options[int(np.argmax(values))]


def log_likelihood_on(fit: Fit, edges: np.ndarray) -> float:
    """The fit's log-likelihood on some of its edges, so that a refit that lost a few can be compared.

    Args:
        edges: mask over all placed edges, a subset of ``fit.use``.
    """
    parts = scatter(fit.runs, fit.placed, edges, fit.blur_mm)
    keep = edges[fit.use]
    value = likelihoods(parts, fit.residual_mm[keep], fit.design[keep], fit.prior)
    return max(value(w.components) for w in fit.whiteners)


def log_likelihood_of(fit: Fit, parts: Scatter, components: Components) -> float:
    """The fit's log-likelihood if its noise had these components."""
    return profile(whitener(parts, components), fit.residual_mm, fit.design, fit.prior)[0]


def _first_sizes(start: Fit, terms: Sequence[Term]) -> tuple[FloatArray, list[tuple[float, ...]]]:
    """The terms roughly sized by one linear step: the mean latency that they add to each run, s, and the sizes."""
    signatures = [term_signature(t, start.view) for t in terms]
    new = np.column_stack([s.columns(start.view) for s in signatures])
    n_base = base_prior(start.law).size
    design = np.column_stack([start.design[:, :n_base], new])
    # The tightest scatter between runs: what the terms are to explain must not count as noise here.
    white = start.whiteners[0]
    a, b = white.apply(design), white.apply(start.residual_mm)
    prior = np.concatenate([start.prior[:n_base], np.full(new.shape[1], 1e-12)])
    sizes = (np.linalg.pinv(a.T @ a + np.diag(prior), hermitian=True) @ (a.T @ b))[n_base:]
    out = np.zeros(len(start.runs))
    each, at = [], 0
    for s in signatures:
        k = s.columns(start.view).shape[1]
        each.append(tuple(float(q) for q in sizes[at : at + k]))
        if s.latency is not None:
            added = s.latency @ sizes[at : at + k]
            for r in range(len(out)):
                own = start.run_index == r
                out[r] += float(added[own].mean()) if own.any() else 0.0
        at += k
    return out, each


def latency_of_terms(fit: Fit) -> FloatArray:
    """Mean latency that the fit's terms add to each run, (runs,) s."""
    out = np.zeros(len(fit.runs))
    for term in fit.terms:
        latency = term_signature(term, fit.view).latency
        if latency is not None:
            added = latency @ np.array(term.sizes)
            for k in np.unique(fit.run_index):
                out[k] += float(added[fit.run_index == k].mean())
    return out
