"""The joint Gauss–Newton fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.constants import LEAST_PRECISION
from draglag.gap.fitting.conclusion import Weighed, concluded
from draglag.gap.fitting.descent import UNUSABLE, Search, descended
from draglag.gap.fitting.likelihood import cost_without_nuisances, likelihoods, profile
from draglag.gap.fitting.model import Geometry, LawParameters, base_prior, starting_law
from draglag.gap.fitting.noise import Components, scatter
from draglag.gap.fitting.search import cost_relative_to
from draglag.gap.fitting.state import State, Term, linearise, term_signature, usable
from draglag.gap.fitting.whitening import Whitener, whitener
from draglag.gap.traces.dewarped import DewarpedKinematics
from draglag.gap.traces.edges import Placed
from draglag.gap.traces.run_data import RunData, undone
from draglag.messages import message
from draglag.recording import FloatArray, Session
from draglag.simulation.effects import EFFECTS, effect_class
from draglag.simulation.residual import Averaged, View

START = Components(tremor_mm_s=1.0, run_mm=0.03)  # weights of a search until it has its own. Physical: a quiet rig


@dataclass(frozen=True, eq=False)
class Fit:
    """Converged joint fit.

    use: mask over placed edges. residual_mm (m,), design (m, p), base then terms, view: of used edges. noises: grid of
    run components; white: of the likeliest. known: mask over placed edges whose state no term leaves unsure.
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
    white: Whitener
    noises: tuple[Components, ...]
    log_likelihood: float
    width_mm: float
    blur_mm: FloatArray
    known: np.ndarray

    @property
    def counted(self) -> np.ndarray:
        """Mask over placed edges by which the gap is measured."""
        return np.asarray(self.use & self.known)

    @property
    def run_index(self) -> np.ndarray:
        return np.asarray(self.placed.run[self.use])


def effects_in(fit: Fit) -> tuple[str, ...]:
    """Sorted ids of effects in terms and law."""
    named = [term.effect for term in fit.terms if term.effect in EFFECTS]
    return tuple(sorted([*named, *effects_in_law(fit)]))


def effects_in_law(fit: Fit) -> tuple[str, ...]:
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
) -> Fit:
    """Joint fit of law, beam and terms.

    start: smaller model, which gives edges, for comparison, and first sizes. law: initial; None: from the runs'
    latencies.

    Raises EstimateError if the session cannot carry the law.
    """
    width_mm = session.screen.width_mm
    runs, terms = _on_their_traces(runs, terms)
    less = None
    if start is not None and terms:
        less, sizes = _first_sizes(start, terms)
        terms = [replace(t, sizes=t.sizes or q) for t, q in zip(terms, sizes, strict=True)]
    laws = [law] if law is not None and (law.plateau_mm_s > 0) == plateau else [starting_law(runs, less, plateau)]
    if law is None and start is not None and (start.law.plateau_mm_s > 0) == plateau:
        laws.append(start.law)
    geometry = _first_geometry(session, runs)
    states = [_begun(runs, begin, geometry, terms, width_mm) for begin in laws]
    use = usable(states[0], runs, loose=True) if start is None else start.use.copy()
    if not use.any():
        raise EstimateError(message("{session}: no edge can be placed on the trace", session=session.name), UNUSABLE)
    search = Search.at(runs, states[0], use, START)
    for other in states[1:]:
        cost, strayed = cost_relative_to(search.white, other, search.state, use)
        if cost < cost_without_nuisances(search.white, search.state, use):
            search = Search.at(runs, other, use & ~strayed, START)
    smaller = None if start is None else start.white.components
    search = descended(session, runs, search, start is not None)
    fit = _fit_at(runs, concluded(runs, search, smaller, width_mm), width_mm)
    if start is None or not _should_contain(fit, start):
        return fit
    search = Search.at(runs, _begun(runs, start.law, start.geometry, terms, width_mm), use, start.white.components)
    search = descended(session, runs, search, True)
    again = _fit_at(runs, concluded(runs, search, smaller, width_mm), width_mm)
    return again if gained_nats(fit, again) > 0 else fit


def _should_contain(fit: Fit, start: Fit) -> bool:
    """Whether a fit is less likely than the smaller one that its model contains: it ended in another valley."""
    alike = type(fit.law) is type(start.law) and (fit.law.plateau_mm_s > 0) == (start.law.plateau_mm_s > 0)
    if fit.runs is not start.runs or not alike:
        return False
    return gained_nats(start, fit) < 0


def _first_geometry(session: Session, runs: tuple[RunData, ...]) -> Geometry:
    """Medians over the runs."""
    found = [d.estimate.alignment for d in runs if d.estimate and d.estimate.alignment]
    middle_mm = float(np.median([0.5 * (a.intercept_top_mm + a.intercept_bottom_mm) for a in found]))
    return Geometry(float(np.median([a.slope for a in found])), middle_mm, session.stylus.diameter_mm)


def _begun(
    runs: tuple[RunData, ...], law: LawParameters, geometry: Geometry, terms: Sequence[Term], width_mm: float
) -> State:
    state = linearise(runs, law, geometry, terms, width_mm, None)
    if any(t.sizes for t in terms):
        state = linearise(runs, law, geometry, state.terms, width_mm, state)
    return state


def _fit_at(runs: tuple[RunData, ...], weighed: Weighed, width_mm: float) -> Fit:
    state, use, white = weighed.search.state, weighed.search.use, weighed.search.white
    residual, design = state.residual[use], state.design[use]
    return Fit(
        runs=runs,
        placed=state.placed,
        use=use,
        law=state.law,
        geometry=state.geometry,
        terms=state.terms,
        residual_mm=residual,
        design=design,
        prior=weighed.prior,
        covariance=profile(white, residual, design, weighed.prior)[1],
        view=restrict(state.view, use),
        white=white,
        noises=weighed.noises,
        log_likelihood=weighed.log_likelihood,
        width_mm=width_mm,
        blur_mm=state.blur_mm,
        known=state.known,
    )


def _on_their_traces(runs: tuple[RunData, ...], terms: Sequence[Term]) -> tuple[tuple[RunData, ...], Sequence[Term]]:
    """Traces with terms undone, and the remaining terms."""
    each = [effect_class(term.effect).undoing(term, runs) for term in terms]
    ready = undone(runs, [what for what, _ in each if what is not None])
    return ready, [left for _, left in each]


def most_promising(before: Fit, options: Sequence[Sequence[Term]], law: LawParameters) -> Sequence[Term]:
    """Terms that fit best under a law, without a refit, weighed by touch noise where the fit before has the edges."""
    values: list[float] = []
    for terms in options:
        state = linearise(before.runs, law, before.geometry, terms, before.width_mm, None)
        state = linearise(before.runs, law, before.geometry, state.terms, before.width_mm, state)
        use = before.use & state.placed.ok & np.isfinite(state.residual)
        white = whitener(scatter(before.runs, state.placed, use, state.blur_mm, before.placed.touch_noise), START)
        value, _ = profile(white, state.residual[use], state.design[use], state.prior)
        values.append(value / max(int(use.sum()), 1))
    return options[int(np.argmax(values))]


def log_likelihood_on(fit: Fit, edges: np.ndarray) -> float:
    """Log-likelihood on a mask of placed edges, within ``fit.use``."""
    parts = scatter(fit.runs, fit.placed, edges, fit.blur_mm)
    keep = edges[fit.use]
    value = likelihoods(parts, fit.residual_mm[keep], fit.design[keep], fit.prior)
    return max(value(one) for one in fit.noises)


def gained_nats(before: Fit, after: Fit) -> float:
    """Log-likelihood gained on common edges."""
    both = before.use & after.use
    return log_likelihood_on(after, both) - log_likelihood_on(before, both)


def _first_sizes(start: Fit, terms: Sequence[Term]) -> tuple[FloatArray, list[tuple[float, ...]]]:
    """Mean latency added to each run, (runs,), and sizes, by one linear step."""
    signatures = [term_signature(t, start.view) for t in terms]
    new = np.column_stack([s.columns(start.view) for s in signatures])
    n_base = base_prior(start.law).size
    design = np.column_stack([start.design[:, :n_base], new])
    # The tightest scatter between runs: what the terms are to explain must not count as noise here.
    white = whitener(scatter(start.runs, start.placed, start.use, start.blur_mm), start.noises[0])
    a, b = white.apply(design), white.apply(start.residual_mm)
    prior = np.concatenate([start.prior[:n_base], np.full(new.shape[1], LEAST_PRECISION)])
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
    """Mean latency that terms add to each run, (runs,)."""
    out = np.zeros(len(fit.runs))
    for term in fit.terms:
        latency = term_signature(term, fit.view).latency
        if latency is not None:
            added = latency @ np.array(term.sizes)
            for k in np.unique(fit.run_index):
                out[k] += float(added[fit.run_index == k].mean())
    return out
