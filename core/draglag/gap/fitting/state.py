"""A point of the joint fit, and the session linearised there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from draglag.gap.constants import LEAST_PRECISION
from draglag.gap.fitting.model import Geometry, LawParameters, base_columns, base_prior, nuisances, residual_mm
from draglag.gap.fitting.noise import timing_mm
from draglag.gap.fitting.signatures import view_of
from draglag.gap.traces.edges import EXACT_S, FEW, Placed, place
from draglag.gap.traces.law_speed import SpeedDelay
from draglag.gap.traces.run_data import RunData
from draglag.recording import FloatArray
from draglag.simulation.effects import EFFECTS, effect_class
from draglag.simulation.residual import Signature, View

ALL_BUT_ITS_OWN = 0.7  # share of a level that rests on one edge: others are no evidence of it. Judgement
STRAYED_S = 0.005  # placed by so much more or less than the model at that place, it has not converged. Derived
FAR_MM = 1.5  # an edge this uncertain decides nothing. Judgement: fifteen times the usual scatter


@dataclass(frozen=True)
class Term:
    """An effect in the model, at setting theta."""

    effect: str
    theta: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()


def term_signature(term: Term, view: View) -> Signature:
    return EFFECTS[term.effect].signature_at(term.theta, view)


def view_with_terms(
    placed: Placed, law: LawParameters, geometry: Geometry, terms: Sequence[Term], width_mm: float
) -> View:
    """All placed edges as the columns of the terms read them."""
    view = view_of(placed, law, geometry, width_mm)
    for term in terms:
        view = effect_class(term.effect).view_with(term.theta, view)
    return view


def prior_of(terms: Sequence[Term], columns: Sequence[FloatArray]) -> FloatArray:
    """Prior precision of a step of each size."""
    each = [max(effect_class(term.effect).prior_sd ** -2, LEAST_PRECISION) for term in terms]
    return np.repeat(each, [c.shape[1] for c in columns]).astype(float)


@dataclass(frozen=True)
class State:
    """known: mask of edges whose state no term leaves unsure. stale: what effects add was evaluated where edges no
    longer lie."""

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
    known: np.ndarray
    stale: bool


def linearise(
    runs: tuple[RunData, ...],
    law: LawParameters,
    geometry: Geometry,
    terms: Sequence[Term],
    width_mm: float,
    before: State | None,
    delay: SpeedDelay | None = None,
) -> State:
    """Session at a point. before: another, where placing begins; delay: of the law's speed; None: by the terms."""
    extra = None if before is None else total(before.signatures, terms, before.view, "latency")
    when = delay or _speed_delay(terms)
    placed = _placed_by_law(runs, law, when) if before is None else place(runs, law, extra, before.placed, when)
    view = view_with_terms(placed, law, geometry, terms, width_mm)
    signatures = tuple(term_signature(t, view) for t in terms)
    stale = False
    if extra is not None:
        # The shift by which an edge was placed has to be the model's at its place; next to a hole it may lie anywhere.
        off_s = np.abs(total(signatures, terms, view, "latency") - extra)
        placed = replace(placed, ok=placed.ok & (off_s <= STRAYED_S))
        stale = bool(np.count_nonzero(off_s[placed.ok] > EXACT_S) > FEW * off_s.size)
    residual = residual_mm(placed, geometry) - total(signatures, terms, view, "offset")
    columns = [s.columns(view) for s in signatures]
    design = np.column_stack([-base_columns(placed, law), *columns])
    prior = np.concatenate([base_prior(law), prior_of(terms, columns)])
    settled = tuple(
        replace(t, theta=s.theta, sizes=t.sizes or (0.0,) * c.shape[1])
        for t, s, c in zip(terms, signatures, columns, strict=True)
    )
    unsure = _unsure_mm(settled, placed)
    blur = np.hypot(unsure, _blur_mm(settled, columns, view, placed))
    if unsure.any():
        placed = replace(placed, unsure_s=_unsure_runs_s(unsure, placed, len(runs)))
    return State(law, geometry, settled, placed, view, signatures, residual, design, prior, blur, unsure == 0, stale)


@lru_cache(maxsize=2)
def _placed_by_law(runs: tuple[RunData, ...], law: LawParameters, delay: SpeedDelay) -> Placed:
    return place(runs, law, delay=delay)


def _speed_delay(terms: Sequence[Term]) -> SpeedDelay:
    """Sum of delays, or the first share of the latency."""
    delays = [one for t in terms if (one := effect_class(t.effect).speed_delay(t.theta)) is not None]
    shares = [one for one in delays if one[0]]
    return shares[0] if shares else (0.0, sum(delay_s for _, delay_s in delays))


def _unsure_mm(terms: Sequence[Term], placed: Placed) -> FloatArray:
    """Standard deviation of each edge, (m,), by states that terms do not know."""
    out = np.zeros(len(placed))
    for term in terms:
        out = np.hypot(out, effect_class(term.effect).unsure_mm(term, placed))
    return np.nan_to_num(out)


def _unsure_runs_s(unsure_mm: FloatArray, placed: Placed, runs: int) -> FloatArray:
    """Standard deviation of the latency of runs most of whose edges are unsure, (runs,): these are unsure alike."""
    out = np.zeros(runs)
    lever_mm_s = np.maximum(np.abs(placed.v_mm_s[:, 1] * placed.stretch), 1.0)
    for k in np.unique(placed.run[unsure_mm > 0]):
        own = (placed.run == k) & placed.ok
        if own.any() and np.median(unsure_mm[own]) > 0:
            out[k] = np.median(unsure_mm[own] / lever_mm_s[own])
    return out


def _blur_mm(terms: Sequence[Term], columns: list[FloatArray], view: View, placed: Placed) -> FloatArray:
    """Error by columns known to a share only."""
    blur = np.zeros(view.x_mm.size)
    for term, column in zip(terms, columns, strict=True):
        share = effect_class(term.effect).unsure_share
        if not share:
            continue
        moved = column @ np.array(term.sizes)
        for k in np.unique(placed.run):
            run = (placed.run == k) & placed.ok
            typical = (
                np.sqrt(np.mean(moved[run] ** 2) / max(np.mean(view.v_across[run] ** 2), 1e-9)) if run.any() else 0
            )
            blur[placed.run == k] += share * typical * view.v_across[placed.run == k]
    return blur


def stepped(
    state: State, step: FloatArray, runs: tuple[RunData, ...], width_mm: float, law: LawParameters | None = None
) -> State:
    """Point a step away. law: replaces the stepped one."""
    own = nuisances(state.law)
    beam, n = own.start - 2, own.stop
    law = law or state.law.moved(step[:beam])
    geometry = replace(
        state.geometry,
        slope=state.geometry.slope + step[beam],
        intercept_mm=state.geometry.intercept_mm + step[beam + 1],
    )
    terms = []
    for t in state.terms:
        k = len(t.sizes)
        sizes = tuple(float(q) for q in np.array(t.sizes) + step[n : n + k])
        theta = effect_class(t.effect).theta_at(t.theta, sizes)
        terms.append(replace(t, sizes=sizes, theta=theta))
        n += k
    there = linearise(runs, law, geometry, terms, width_mm, state)
    if there.stale:
        there = linearise(runs, law, geometry, there.terms, width_mm, there)
    return there


def usable(state: State, runs: tuple[RunData, ...], loose: bool) -> np.ndarray:
    """Edges well placed, not outlying in their run, not too uncertain."""
    placed = state.placed
    use = placed.ok & np.isfinite(state.residual) & np.isfinite(state.design).all(1)
    follows = placed.v_mm_s[:, 1] * placed.stretch * placed.slope_s2_mm
    local = placed.touch_variance_mm2 + state.blur_mm**2
    sd = np.sqrt(local + 0.05**2 + (0.02 * follows * placed.speed_mm_s) ** 2 + timing_mm(placed) ** 2)
    use &= sd < FAR_MM
    # A run that mostly starts and stops is no evidence on a law: its few edges left would stand for those excluded.
    for k, data in enumerate(runs):
        own = placed.run == k
        if not data.steady and np.count_nonzero(use & own) < 0.5 * np.count_nonzero(own):
            use[own] = False
    return np.asarray(use & _not_far(state.residual, sd, placed, use, loose))


def total(signatures: Sequence[Signature], terms: Sequence[Term], view: View, role: str) -> FloatArray:
    total = np.zeros(view.x_mm.size)
    for s, t in zip(signatures, terms, strict=True):
        columns = getattr(s, role)
        if columns is not None and t.sizes:
            total = total + columns @ np.array(t.sizes)
    return total


def _not_far(residual: FloatArray, sd: FloatArray, placed: Placed, use: np.ndarray, loose: bool) -> np.ndarray:
    keep = np.ones(residual.size, bool)
    most = 9 if loose else 5
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
        left, leverage = _residual_after_levels(z, design)
        # An edge that alone has a level of its own has leverage 1: what it leaves is little, wherever it lies, and
        # others are judged without it.
        alone = (leverage > ALL_BUT_ITS_OWN) & (left > most)
        if alone.any():
            keep[own[alone]] = False
            own = own[~alone]
            left = _residual_after_levels(z[~alone], design[~alone])[0]
        keep[own[left > most]] = False
    return keep


def _residual_after_levels(z: FloatArray, design: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Studentised residuals of a robust fit, leverages; (m,)."""
    weight = np.ones(z.size)
    for _ in range(5):
        beta = np.linalg.lstsq(design * weight[:, None], z * weight, rcond=None)[0]
        left = np.abs(z - design @ beta)
        scale = max(1.4826 * float(np.median(left)), 0.5)
        weight = np.sqrt(np.minimum(1.0, 2 * scale / np.maximum(left, 1e-9)))
    leverage = np.sum(np.linalg.qr(design * weight[:, None])[0] ** 2, axis=1)
    return left / (scale * np.sqrt(np.maximum(1 - leverage, 1e-3))), leverage
