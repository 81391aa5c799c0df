"""The joint fit: curve, beam and all accepted effects, by Gauss–Newton under the session's own noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from draglag.gap.edges import Placed, RunData, place
from draglag.gap.model import (
    N_NUISANCES,
    Geometry,
    LawParameters,
    base_columns,
    base_prior,
    residual_mm,
    starting_law,
)
from draglag.gap.noise import (
    BETWEEN,
    EDGE_MM,
    LOCAL,
    SPEED,
    Components,
    Scatter,
    Whitener,
    scatter,
    timing_mm,
    touch_variances,
    whitener,
)
from draglag.gap.signatures import view_of
from draglag.gap.unwarped import Unwarped
from draglag.recording import FloatArray, Session
from draglag.simulation.effects import EFFECTS
from draglag.simulation.residual import Averaged, Signature, View

START = Components(0.05, 0.01, 0.1, 0.0003, 0.03)
FOLLOW_ACCELERATION = ("acceleration_lag", "lagging_law")
ACCEL_UNKNOWN = 0.2
FAR_MM = 1.5  # an edge this uncertain decides nothing


@dataclass(frozen=True)
class Term:
    """An effect in the model. theta: its non-linear setting; sizes: (k,) amplitudes in the signature's units."""

    effect: str
    theta: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()


@dataclass(frozen=True)
class Fit:
    """A converged joint fit.

    Attributes (m used edges): use: mask over placed; residual_mm; design (m, p): columns that explain residuals, base
    then terms; view: restricted to the used edges; whiteners: one a grid point; best: index of the likeliest.
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

    @property
    def run_index(self) -> np.ndarray:
        return np.asarray(self.placed.run[self.use])


def term_signature(term: Term, view: View) -> Signature:
    """The signature of a term at its setting."""
    return EFFECTS[term.effect].signature_at(term.theta, view)


def restrict(view: View, use: np.ndarray) -> View:
    arrays: dict[str, Any] = {
        k: v[use] for k, v in view.__dict__.items() if isinstance(v, np.ndarray | Averaged | Unwarped)
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
    """Fit law, beam and terms jointly.

    ``start`` is a fit of a smaller model: its edges are judged by, so that the two can be compared, and it sizes the
    new terms. ``law`` is where to begin instead of the runs' own latencies.

    Raises EstimateError when the session cannot carry the law.
    """
    width = session.screen.width_mm
    less = None
    sizes: list[tuple[float, ...]] = [() for _ in terms]
    if start is not None and terms:
        less, sizes = _first_sizes(start, terms)
    if law is None or (law.plateau_mm_s > 0) != plateau:
        law = starting_law(runs, less, plateau)
    slopes = [(d.estimate.alignment.slope, d.estimate.alignment) for d in runs if d.estimate and d.estimate.alignment]
    slope = float(np.median([s for s, _ in slopes]))
    middle = float(np.median([0.5 * (a.intercept_top_mm + a.intercept_bottom_mm) for _, a in slopes]))
    geometry = Geometry(slope, middle, session.stylus.diameter_mm)
    placed: Placed | None = None
    active = [replace(t, sizes=t.sizes or q) for t, q in zip(terms, sizes, strict=True)]
    components = START
    state = _look(runs, law, geometry, active, width, None)
    if any(t.sizes for t in active):
        state = _look(runs, law, geometry, state.terms, width, state)
    use = _usable(state, runs, loose=True) if start is None else start.use.copy()
    settled = judged = False
    damping = 0.0
    for iteration in range(12):
        parts = scatter(runs, state.placed, use, state.blur_mm)
        if (iteration == 4 and not judged) or settled:
            settled = False
            judged = True
            use = use & _usable(state, runs, loose=False) if start is None else use & state.placed.ok
            parts = scatter(runs, state.placed, use, state.blur_mm)
            # A run's own latency is kept small here, or the law would be free to leave a gap instead of closing it.
            likely = _likeliest(parts, state.residual[use], state.design[use], state.prior, (components,), rounds=1)
            components = replace(likely, run_s=min(likely.run_s, 1e-3), run_mm=min(likely.run_mm, 0.03))
        white = whitener(parts, components)
        a, b = white.apply(state.design[use]), white.apply(state.residual[use])
        calm = 1 / np.sqrt(np.maximum(1.0, np.abs(b) / 4))  # Huber: far edges pull, but not with their square
        normal = (a * calm[:, None]).T @ (a * calm[:, None])
        moment = (a * calm[:, None]).T @ (b * calm)
        cost = _cost_without_nuisances(white, state, use)
        for _ in range(6):
            # Levenberg–Marquardt: Eq. 5's amplitudes and rates lie in a valley that plain steps leave.
            damped = normal + np.diag(state.prior + damping * np.diag(normal))
            step = np.linalg.pinv(damped, hermitian=True) @ moment
            trial = _stepped(state, step, runs, width)
            both = use & np.isfinite(trial.residual)
            if np.count_nonzero(both) == np.count_nonzero(use):
                new_cost = _cost_without_nuisances(white, trial, use)
                if new_cost <= cost + 0.1:  # placing an edge is exact to a few µm only
                    damping = damping / 10 if damping > 1e-5 else 0.0
                    break
            damping = max(10 * damping, 1e-3)
        else:
            settled = not judged
            if judged:
                break
            continue
        gained = cost - new_cost
        state = trial
        if iteration < 4 and start is None:
            use = _usable(state, runs, loose=iteration < 2)
        if judged and gained < 0.05:
            break
        settled = not judged and gained < 0.5 and iteration >= 2
    placed, view, law, geometry, active = state.placed, state.view, state.law, state.geometry, list(state.terms)
    use = use & (_usable(state, runs, loose=False) if start is None else placed.ok)
    parts = scatter(runs, placed, use, state.blur_mm)
    far = replace(components, edge_mm=EDGE_MM[0], speed=SPEED[-1])
    components = _likeliest(parts, state.residual[use], state.design[use], state.prior, (components, far))
    residual, design, prior = state.residual, state.design, state.prior
    whiteners = tuple(whitener(parts, replace(components, run_s=a, run_mm=b)) for a, b in BETWEEN)
    prior = np.concatenate([base_prior(law), np.full(design.shape[1] - base_prior(law).size, 1e-12)])
    values = [_profile(w, residual[use], design[use], prior)[0] for w in whiteners]
    best = int(np.argmax(values))
    _, spread = _profile(whiteners[best], residual[use], design[use], prior)
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
    )


def most_promising(before: Fit, options: Sequence[Sequence[Term]], law: LawParameters) -> Sequence[Term]:
    """Of several sets of sized terms beside a law, the one that the edges of ``before`` fit best, unrefined."""
    values: list[float] = []
    for terms in options:
        state = _look(before.runs, law, before.geometry, terms, before.width_mm, None)
        state = _look(before.runs, law, before.geometry, state.terms, before.width_mm, state)
        use = before.use & state.placed.ok & np.isfinite(state.residual)
        white = whitener(scatter(before.runs, state.placed, use, state.blur_mm), START)
        value, _ = _profile(white, state.residual[use], state.design[use], state.prior)
        values.append(value / max(int(use.sum()), 1))
    return options[int(np.argmax(values))]


def log_likelihood_on(fit: Fit, edges: np.ndarray) -> float:
    """The fit's log-likelihood on some of its edges, so that a refit that lost a few can be compared.

    Args:
        edges: mask over all placed edges, a subset of ``fit.use``.
    """
    parts = scatter(fit.runs, fit.placed, edges, fit.blur_mm)
    keep = edges[fit.use]
    values = [
        _profile(whitener(parts, w.components), fit.residual_mm[keep], fit.design[keep], fit.prior)[0]
        for w in fit.whiteners
    ]
    return float(max(values))


def log_likelihood_of(fit: Fit, parts: Scatter, components: Components) -> float:
    """The fit's log-likelihood if its noise had these components."""
    return _profile(whitener(parts, components), fit.residual_mm, fit.design, fit.prior)[0]


@dataclass(frozen=True)
class _State:
    """One point of the search: parameters, and the session seen from there."""

    law: LawParameters
    geometry: Geometry
    terms: tuple[Term, ...]
    placed: Placed
    view: View
    signatures: tuple[Signature, ...]
    residual: FloatArray
    design: FloatArray
    prior: FloatArray
    blur_mm: FloatArray


def _look(
    runs: tuple[RunData, ...],
    law: LawParameters,
    geometry: Geometry,
    terms: Sequence[Term],
    width_mm: float,
    before: _State | None,
) -> _State:
    extra = None if before is None else _total(before.signatures, terms, before.view, "latency")
    placed = place(runs, law, extra, None if before is None else before.placed)
    view = view_of(placed, law, geometry, width_mm)
    lag = next((t.theta[0] for t in terms if t.effect == "acceleration_lag" and t.theta), 0.0)
    if lag > 0:
        view = replace(view, accel=view.trace.acceleration_mm_s2(lag))
    signatures = tuple(term_signature(t, view) for t in terms)
    residual = residual_mm(placed, geometry) - _total(signatures, terms, view, "offset")
    columns = [s.columns(view) for s in signatures]
    design = np.column_stack([-base_columns(placed, law), *columns])
    prior = np.concatenate([base_prior(law), np.full(sum(c.shape[1] for c in columns), 1e-12)])
    settled = tuple(
        replace(t, theta=s.theta, sizes=t.sizes or (0.0,) * c.shape[1])
        for t, s, c in zip(terms, signatures, columns, strict=True)
    )
    blur = _blur_mm(settled, columns, view, placed)
    return _State(law, geometry, settled, placed, view, signatures, residual, design, prior, blur)


def _blur_mm(terms: Sequence[Term], columns: list[FloatArray], view: View, placed: Placed) -> FloatArray:
    """What effects of the acceleration leave at each edge, mm: it is known to about a fifth of what it varies by."""
    blur = np.zeros(view.x_mm.size)
    for term, column in zip(terms, columns, strict=True):
        if term.effect not in FOLLOW_ACCELERATION:
            continue
        moved = column @ np.array(term.sizes)
        for k in np.unique(placed.run):
            run = (placed.run == k) & placed.ok
            typical = (
                np.sqrt(np.mean(moved[run] ** 2) / max(np.mean(view.v_across[run] ** 2), 1e-9)) if run.any() else 0
            )
            blur[placed.run == k] += ACCEL_UNKNOWN * typical * view.v_across[placed.run == k]
    return blur


def _stepped(state: _State, step: FloatArray, runs: tuple[RunData, ...], width_mm: float) -> _State:
    n = base_prior(state.law).size
    beam = n - N_NUISANCES - 2
    law = state.law.moved(step[:beam])
    geometry = replace(
        state.geometry,
        slope=state.geometry.slope + step[beam],
        intercept_mm=state.geometry.intercept_mm + step[beam + 1],
    )
    terms = []
    for t in state.terms:
        k = len(t.sizes)
        sizes = tuple(float(q) for q in np.array(t.sizes) + step[n : n + k])
        # The trace is unwarped by what is found in it.
        theta = (max(sizes[0], 0.0),) if t.effect == "acceleration_lag" else t.theta
        terms.append(replace(t, sizes=sizes, theta=theta))
        n += k
    return _look(runs, law, geometry, terms, width_mm, state)


def _usable(state: _State, runs: tuple[RunData, ...], loose: bool) -> np.ndarray:
    """Edges to judge by: well placed, not far from their run, and not too uncertain to matter."""
    placed = state.placed
    use = placed.ok & np.isfinite(state.residual) & np.isfinite(state.design).all(1)
    follows = placed.v_mm_s[:, 1] * placed.stretch * placed.slope_s2_mm
    local = touch_variances(runs, placed) + state.blur_mm**2
    sd = np.sqrt(local + 0.05**2 + (0.02 * follows * placed.speed_mm_s) ** 2 + timing_mm(placed) ** 2)
    use &= sd < FAR_MM
    # A run that mostly starts and stops is no witness to a law: its few edges left would speak for those that went.
    for k, data in enumerate(runs):
        own = placed.run == k
        if not data.steady and np.count_nonzero(use & own) < 0.5 * np.count_nonzero(own):
            use[own] = False
    return np.asarray(use & _not_far(state.residual, sd, placed, use, loose))


def _cost_without_nuisances(white: Whitener, state: _State, use: np.ndarray) -> float:
    """Huber's cost after the best nuisances: a step must not be refused for what they would take up."""
    end = base_prior(state.law).size
    nuisance = slice(end - N_NUISANCES, end)
    a, b = white.apply(state.design[use][:, nuisance]), white.apply(state.residual[use])
    precision: FloatArray = state.prior[nuisance]
    left: FloatArray = b
    for _ in range(2):
        calm = a / np.maximum(1.0, np.abs(left) / 4)[:, None]
        size = np.linalg.solve(calm.T @ a + np.diag(precision), calm.T @ b)
        left = np.asarray(b - a @ size, float)
    return _calm_cost(left) + 0.5 * float(size**2 @ precision)


def _calm_cost(z: FloatArray) -> float:
    """Huber's cost with its corner at 4 standard deviations."""
    size = np.abs(z)
    return float(np.sum(np.where(size < 4, 0.5 * size**2, 4 * size - 8)))


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


def _total(signatures: Sequence[Signature], terms: Sequence[Term], view: View, role: str) -> FloatArray:
    total = np.zeros(view.x_mm.size)
    for s, t in zip(signatures, terms, strict=True):
        columns = getattr(s, role)
        if columns is not None and t.sizes:
            total = total + columns @ np.array(t.sizes)
    return total


def _not_far(residual: FloatArray, sd: FloatArray, placed: Placed, use: np.ndarray, loose: bool) -> np.ndarray:
    """Edges within a few robust standard deviations of their own run, whatever latency and offset that run has."""
    keep = np.ones(residual.size, bool)
    for k in np.unique(placed.run):
        own = np.flatnonzero((placed.run == k) & use)
        if own.size < 6:
            continue
        v = placed.v_mm_s[own, 1]
        size = max(float(np.abs(v).max()), 1.0)
        # Each kind of edge and direction its own level: hysteresis, width and asymmetry are not outliers.
        side = np.where(placed.falling[own], 1.0, -1.0)
        columns = [np.ones_like(v), v / size, side, np.abs(v) / size, side * v / size, side * np.sign(v)]
        design = np.column_stack(columns) if own.size > 20 else np.column_stack(columns[:2])
        z, design = residual[own] / sd[own], design / sd[own][:, None]
        weight = np.ones(v.size)
        for _ in range(5):
            beta = np.linalg.lstsq(design * weight[:, None], z * weight, rcond=None)[0]
            left = np.abs(z - design @ beta)
            scale = max(1.4826 * float(np.median(left)), 0.5)
            weight = np.sqrt(np.minimum(1.0, 2 * scale / np.maximum(left, 1e-9)))
        keep[own[left > (9 if loose else 5) * scale]] = False
    return keep


def _profile(white: Whitener, residual: FloatArray, design: FloatArray, prior: FloatArray) -> tuple[float, FloatArray]:
    """Log likelihood with the linear parameters at their best, and their covariance."""
    a, b = white.apply(design), white.apply(residual)
    spread = np.linalg.pinv(a.T @ a + np.diag(prior), hermitian=True)
    moment = a.T @ b
    value = -0.5 * (float(b @ b) - float(moment @ spread @ moment)) - 0.5 * white.log_det
    return value, np.asarray(spread, float)


def _likeliest(
    parts: Scatter,
    residual: FloatArray,
    design: FloatArray,
    prior: FloatArray,
    starts: Sequence[Components],
    rounds: int = 2,
) -> Components:
    """The components of greatest likelihood: one kind after the other, from several starts, for they trade places."""

    @cache
    def value(components: Components) -> float:
        return _profile(whitener(parts, components), residual, design, prior)[0]

    ends = []
    for best in starts:
        for _ in range(rounds):
            for name, grid in LOCAL:
                best = max((replace(best, **{name: size}) for size in grid), key=value)
            best = max((replace(best, run_s=a, run_mm=b) for a, b in BETWEEN), key=value)
        ends.append(best)
    return max(ends, key=value)
