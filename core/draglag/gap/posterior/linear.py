"""A session linearised about one fit.

r = A b + T t + Σ X_j g_j + e (docs/gap.md); b, t and g are integrated out (Rasmussen & Williams 2006, sections 2.3 and
2.7).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular

from draglag.gap import constants
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.law_form import FlexibleLaw, nearest_eq5
from draglag.gap.fitting.model import LawParameters, base_prior
from draglag.gap.fitting.noise import Components, Scatter, scatter
from draglag.gap.fitting.whitening import inner_products
from draglag.gap.posterior.levels import PARTS, log_prior, within_sound
from draglag.gap.posterior.members import Member, members_of, of_unit_rms, smooth_columns
from draglag.recording import FloatArray, IntArray
from draglag.simulation.effects import effect_class

ENOUGH = 0.5  # nats that one round over the levels still gains. Derived: below one
ROUNDS = 10  # over the levels at most; of 49 searches of four sessions none took more than four. Derived: cost


@dataclass(frozen=True)
class Linear:
    """One linearisation on m edges.

    residual_mm (m,): without members. base (m, p): A, of prior precision (a,), and T. columns (m, q): of members, 1 mm
    RMS. at: each member's columns. edges: mask over placed edges; None: the fit's.
    """

    fit: Fit
    members: tuple[Member, ...]
    residual_mm: FloatArray
    base: FloatArray
    precision: FloatArray
    columns: FloatArray
    at: tuple[IntArray, ...]
    parts: Scatter
    unsure_ages: bool
    law: LawParameters
    edges: np.ndarray | None
    whole: Whole

    def precision_at(self, levels: Components) -> FloatArray:
        """Prior precision of the base columns, (p,).

        Errors of the placing may be of any shape. Without their variance in every direction, the difference of two
        large columns that are nearly alike would explain them.
        """
        tolerated_mm2 = (levels.misfit_mm * self.whole.singular) ** 2 + constants.ROUNDING_MM**2
        return np.append(self.precision, 1 / tolerated_mm2)

    def on(self, edges: np.ndarray) -> Linear:
        """Linearisation on a mask of placed edges."""
        same = self.edges is not None and np.array_equal(self.edges, edges)
        return self if same else _restricted(self.whole, edges)

    @property
    def model(self) -> FloatArray:
        """Columns (m, k) of Eq. 5 and the beam."""
        return self.base[:, : len(self.law.step_sd) + 2]


@dataclass(frozen=True)
class Normal:
    """Normal equations of members: gram (q, q), moment (q,); base: log evidence without members."""

    levels: Components
    gram: FloatArray
    moment: FloatArray
    base: float


@dataclass(frozen=True)
class Whole:
    """``Linear`` on all edges of a fit. singular: of the tolerance, (k,)."""

    fit: Fit
    members: tuple[Member, ...]
    residual_mm: FloatArray
    base: FloatArray
    precision: FloatArray
    singular: FloatArray
    parts: Scatter
    unsure_ages: bool
    law: LawParameters


def linearised(
    fit: Fit, allowed: Sequence[str] | frozenset[str], unsure_ages: bool = False, edges: np.ndarray | None = None
) -> Linear:
    """Session linearised about a fit. edges: mask over placed edges; None: the fit's."""
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    possible = members_of(fit, parts, allowed)
    listed = {member.name for member in possible}  # at every setting, with its share of the prior
    members = (*(member for member in _own(fit) if member.name not in listed), *possible)
    base, prior, residual, law = _without_members(fit)
    tolerance, singular = tolerance_of(fit, members)
    precision = np.maximum(prior, constants.LEAST_PRECISION)
    base = np.column_stack([base, tolerance])
    whole = Whole(fit, members, residual, base, precision, singular, parts, unsure_ages, law)
    return _restricted(whole, edges)


def _restricted(whole: Whole, edges: np.ndarray | None) -> Linear:
    fit, parts = whole.fit, whole.parts
    keep = np.ones(fit.residual_mm.size, bool) if edges is None else edges[fit.use]
    if not keep.all():
        parts = scatter(fit.runs, fit.placed, fit.use & edges, fit.blur_mm)
    ends = np.cumsum([0, *(member.columns.shape[1] for member in whole.members)])
    return Linear(
        fit,
        whole.members,
        whole.residual_mm[keep],
        whole.base[keep],
        whole.precision,
        np.column_stack([of_unit_rms(member.columns[keep]) for member in whole.members]),
        tuple(np.arange(a, b) for a, b in pairwise(ends)),
        parts,
        whole.unsure_ages,
        whole.law,
        edges,
        whole,
    )


def _own(fit: Fit) -> list[Member]:
    out, at = [], base_prior(fit.law).size
    for term in fit.terms:
        own = fit.design[:, at : at + len(term.sizes)]
        at += len(term.sizes)
        prior = float(np.log(constants.P_EFFECT)) + effect_class(term.effect).log_prior_of(term.theta)
        out.append(Member(term.effect, term.theta, own, prior))
    return out


def _without_members(fit: Fit) -> tuple[FloatArray, FloatArray, FloatArray, LawParameters]:
    """Base columns (m, p), prior precision (p,), residual (m,) without terms, nearest Eq. 5."""
    at = base_prior(fit.law).size
    base, residual, prior = fit.design[:, :at], fit.residual_mm.copy(), fit.prior[:at]
    for term in fit.terms:
        k = len(term.sizes)
        residual += fit.design[:, at : at + k] @ np.array(term.sizes)
        at += k
    if not isinstance(fit.law, FlexibleLaw):
        return base, prior, residual, fit.law
    lever, speed = fit.view.v_across * fit.view.stretch, fit.view.speed
    nearest = nearest_eq5(fit.law, speed)
    residual -= lever * (fit.law(speed) - nearest(speed))
    of_law = len(fit.law.step_sd)
    base = np.column_stack([-lever[:, None] * nearest.columns(speed), base[:, of_law:]])
    return base, np.append(base_prior(nearest)[: len(nearest.step_sd)], prior[of_law:]), residual, nearest


def tolerance_of(fit: Fit, members: Sequence[Member]) -> tuple[FloatArray, FloatArray]:
    """Orthogonal directions (m, k), 1 mm RMS each, that the columns of smooth shapes and effects span, and the singular
    values (k,) of those columns, 1 mm RMS each, along them."""
    blocks = [of_unit_rms(c) for c in smooth_columns(fit).values()]
    by_name: dict[str, list[Member]] = {}
    for member in members:
        if member.named:
            by_name.setdefault(member.name, []).append(member)
    for settings in by_name.values():
        step = max(1, len(settings) // constants.TOLERATED_SETTINGS)
        blocks += [of_unit_rms(m.columns) for m in settings[::step]]
    columns = np.column_stack(blocks)
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    unit = np.sqrt(columns.shape[0])
    known = size > constants.ROUNDING_MM * unit
    return np.asarray(left[:, known] * unit), np.asarray(size[known] / unit)


def normal(linear: Linear, levels: Components) -> Normal:
    p = linear.base.shape[1]
    products = inner_products(linear.parts, np.column_stack([linear.base, linear.columns, linear.residual_mm]))
    inner, log_det = products(levels)
    of_base = inner[np.ix_([*range(p), -1], [*range(p), -1])]
    root, scale, value = _base_value(linear.precision_at(levels), of_base, log_det)
    through = solve_triangular(root, scale[:, None] * inner[:p, p:], lower=True)
    left = inner[p:, p:] - through.T @ through
    return Normal(levels, left[:-1, :-1], left[:-1, -1], value + log_prior(levels, linear.unsure_ages))


def _base_value(
    precision: FloatArray, inner: FloatArray, log_det: float, extra: int = 0
) -> tuple[FloatArray, FloatArray, float]:
    """Cholesky factor and scale of the information, log evidence.

    precision: of the base, (p,). inner: products of base, ``extra`` columns of unit prior, and residual.
    """
    precision = np.append(precision, np.ones(extra))
    information = inner[:-1, :-1].copy()
    information[np.diag_indices_from(information)] += precision
    scale = 1 / np.sqrt(np.diag(information))
    root = np.asarray(np.linalg.cholesky(information * scale[:, None] * scale), np.float64)
    half = solve_triangular(root, scale * inner[:-1, -1], lower=True)
    value = -0.5 * float(inner[-1, -1] - half @ half) - 0.5 * log_det
    value += float(np.log(scale).sum() - np.log(np.diag(root)).sum() + 0.5 * np.log(precision).sum())
    return root, scale, value


def likeliest_levels(
    linear: Linear,
    chosen: Sequence[int] = (),
    sizes_mm: Sequence[float] = (),
    start: Components | None = None,
    sound: bool = False,
) -> Components:
    """Likeliest levels given members. sound: only those of sound rigs."""
    own = [linear.columns[:, linear.at[i]] * s for i, s in zip(chosen, sizes_mm, strict=True)]
    extra = sum(c.shape[1] for c in own)
    products = inner_products(linear.parts, np.column_stack([linear.base, *own, linear.residual_mm]))

    @cache
    def value(levels: Components) -> float:
        evidence = _base_value(linear.precision_at(levels), *products(levels), extra)[2]
        return evidence + log_prior(levels, linear.unsure_ages)

    levels = start or Components()
    levels = within_sound(levels) if sound else levels
    for _ in range(ROUNDS):
        before = value(levels)
        for name, part in PARTS.items():
            grid = [x for x in part.values if not sound or x <= part.sound * 1.001]
            levels = _along(levels, name, grid, value)
        if value(levels) - before < ENOUGH:
            break
    return levels


def _along(levels: Components, name: str, grid: Sequence[float], value: Callable[[Components], float]) -> Components:
    at = int(np.argmin(np.abs(np.array(grid) - getattr(levels, name))))
    best = value(levels)
    for way in (1, -1):
        k = at + way
        while 0 <= k < len(grid):
            other = replace(levels, **{name: grid[k]})
            if value(other) <= best + 1e-9:
                break
            levels, best, k = other, value(other), k + way
    return levels
