"""Whether the curve's own form falls with speed."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from draglag.gap import constants
from draglag.gap.fitting.law_form import LAW_FORM, basis
from draglag.gap.fitting.whitening import inner_products
from draglag.gap.posterior.linear import Linear, Normal
from draglag.recording import FloatArray

DRAWS, SPEEDS = 4000, 30  # of the curve: a probability to 0.01. Derived


def falling_share(linear: Linear, levels: Normal, members: tuple[int, ...], scales_mm: tuple[float, ...]) -> float:
    """Probability that the curve rises nowhere by more than the size of interest."""
    names = [linear.members[i].name for i in members]
    which = names.index(LAW_FORM)
    parts = [linear.columns[:, linear.at[i]] * s for i, s in zip(members, scales_mm, strict=True)]
    inner, _ = inner_products(linear.parts, np.column_stack([linear.base, *parts, linear.residual_mm]))(levels.levels)
    precision = np.append(linear.precision_at(levels.levels), np.ones(sum(p.shape[1] for p in parts)))
    information, moment = inner[:-1, :-1].copy(), inner[:-1, -1]
    information[np.diag_indices_from(information)] += precision
    scale = 1 / np.sqrt(np.diag(information))
    root = np.linalg.cholesky(information * np.outer(scale, scale))
    begin = linear.base.shape[1] + sum(p.shape[1] for p in parts[:which])
    of_law = len(linear.law.step_sd)
    own = [*range(of_law), *range(begin, begin + parts[which].shape[1])]
    half = solve_triangular(root, np.diag(scale)[:, own], lower=True)
    mean = half.T @ solve_triangular(root, scale * moment, lower=True)
    noise = np.random.default_rng(constants.SEED).standard_normal((DRAWS, len(own)))
    draws = (mean + noise @ np.linalg.qr(half, mode="r")).T
    form = draws[of_law:] * scales_mm[which]
    rise_mm = _rise_mm(linear, linear.members[members[which]].theta, draws[:of_law], form)
    return float((np.count_nonzero(rise_mm < constants.SIZE_OF_INTEREST_MM) + 0.5) / (DRAWS + 1))


def _rise_mm(linear: Linear, knots: tuple[float, ...], law: FloatArray, form: FloatArray) -> FloatArray:
    """Largest rise, as displacement at the lower speed, (draws,). law: (p, draws); form: (k, draws)."""
    member = next(m for m in linear.members if m.name == LAW_FORM)
    size = max(float(np.sqrt(np.mean(member.columns**2) * member.columns.shape[1])), 1e-12)
    low, high = np.quantile(linear.fit.view.speed, [0.02, 0.98])
    speed = np.geomspace(low, high, SPEEDS)
    curve = linear.law(speed)[:, None] + linear.law.columns(speed) @ law + basis(speed, knots) @ (form / size)
    lowest = np.minimum.accumulate(curve, axis=0)
    at = np.array([np.argmin(curve[: k + 1], axis=0) for k in range(SPEEDS)])
    return np.asarray(np.max((curve - lowest) * speed[at], axis=0))
