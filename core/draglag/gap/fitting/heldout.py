"""The gap on held-out runs, and its noise floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.constants import GROWS_BY, LEAST_PRECISION, PREDICTS_NATS, SHRINKS_BY
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.noise import scatter
from draglag.gap.fitting.whitening import whitener
from draglag.recording import FloatArray, IntArray

FOLDS = 5  # of the runs. Judgement: the usual number
SINGULAR = 1e-13  # least eigenvalue of an information with a diagonal of one: below it there is rounding. Derived
IN_EVERY_FIT = -1  # number of the fold of such a run. Derived


def folds(fit: Fit) -> IntArray:
    """Fold of each used edge, (m,), by run, neighbouring speeds apart; −1, in every fit: extreme speeds run once."""
    nominal = [data.run.nominal_speed_mm_s for data in fit.runs]
    steady = sorted((round(float(v), 1), k) for k, v in enumerate(nominal) if v is not None)
    fold_of_run = {k: place % FOLDS for place, (_, k) in enumerate(steady)}
    speeds = [v for v, _ in steady]
    if len(set(speeds)) > 4:
        fold_of_run |= {k: IN_EVERY_FIT for v, k in (steady[0], steady[-1]) if speeds.count(v) == 1}
    fold: IntArray = np.array([fold_of_run.get(k, k % FOLDS) for k in range(len(nominal))], np.int64)
    return np.asarray(fold[fit.run_index])


def held_out_residual_mm(fit: Fit) -> FloatArray:
    """Residual of each used edge, fitted without its fold, (m,)."""
    fold = folds(fit)
    a, b = _white(fit)
    out = fit.residual_mm.copy()
    for k in np.unique(fold[fold != IN_EVERY_FIT]):
        train, test = fold != k, fold == k
        spread = _spread(fit, a[train])
        out[test] = fit.residual_mm[test] - fit.design[test] @ (spread @ (a[train].T @ b[train]))
    return out


def noise_variance_mm2(fit: Fit) -> FloatArray:
    """Variance of held-out residuals by noise, (m,), without level and uneven following of changing speeds."""
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    noise_mm = np.where(fit.placed.steady[fit.use], parts.uneven_mm, 0.0)
    parts = replace(parts, loose_s=np.zeros(len(fit.runs)), uneven_mm=noise_mm)
    variance = whitener(parts, fit.white.components).variance_mm2.copy()
    fold = folds(fit)
    a, _ = _white(fit)
    for k in np.unique(fold[fold != IN_EVERY_FIT]):
        test = fold == k
        variance[test] += np.einsum("ij,jk,ik->i", fit.design[test], _spread(fit, a[~test]), fit.design[test])
    return np.asarray(variance)


def _white(fit: Fit) -> tuple[FloatArray, FloatArray]:
    white = fit.white
    return white.apply(fit.design), white.apply(fit.residual_mm)


def _spread(fit: Fit, design: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.pinv(design.T @ design + np.diag(fit.prior), hermitian=True))


def _counted(fit: Fit, edges: np.ndarray | None, whole: bool = False) -> np.ndarray:
    counted = fit.counted if edges is None else edges & fit.known
    return np.asarray(counted[fit.use] if whole else counted[fit.use] & (folds(fit) != IN_EVERY_FIT))


def gap_mm(fit: Fit, edges: np.ndarray | None = None, whole: bool = False) -> float:
    """RMS residual on held-out runs, of edges whose state is known. edges: mask over placed edges; None: all.

    whole: with the residual of the fit itself on runs that are in every fit.
    """
    return float(np.sqrt(np.mean(held_out_residual_mm(fit)[_counted(fit, edges, whole)] ** 2)))


def floor_mm(fit: Fit, edges: np.ndarray | None = None, whole: bool = False) -> float:
    """``gap_mm`` by noise alone."""
    return float(np.sqrt(np.mean(noise_variance_mm2(fit)[_counted(fit, edges, whole)])))


def predictive_gain(before: Fit, after: Fit) -> float:
    """Gain of log predictive density on shared held-out edges, each under its own noise."""
    both = before.use & after.use
    return _log_predictive(after, both) - _log_predictive(before, both)


def _log_predictive(fit: Fit, edges: np.ndarray) -> float:
    """Log density of each fold's edges by a fit to the others, whose own error belongs to it: where a fold alone shows
    the curve, others foretell it widely."""
    keep = edges[fit.use]
    white = whitener(scatter(fit.runs, fit.placed, edges, fit.blur_mm), fit.white.components)
    a, b, fold = white.apply(fit.design[keep]), white.apply(fit.residual_mm[keep]), folds(fit)[keep]
    whole = a.T @ a + np.diag(fit.prior)
    scale = 1 / np.sqrt(np.diag(whole))
    spread, log_det = _inverse(whole, scale)
    value = -0.5 * (white.log_det + float(np.sum(b[fold == IN_EVERY_FIT] ** 2)))
    for k in np.unique(fold[fold != IN_EVERY_FIT]):
        own = a[fold == k]
        others, log_det_others = _inverse(whole - own.T @ own, scale)
        off = b[fold == k] - own @ (others @ (a[fold != k].T @ b[fold != k]))
        along = own.T @ off
        value -= 0.5 * (float(off @ off - along @ spread @ along) + log_det - log_det_others)
    return value


def _inverse(information: FloatArray, scale: FloatArray) -> tuple[FloatArray, float]:
    """Inverse, and log determinant in units of ``scale``."""
    values, axes = np.linalg.eigh(information * np.outer(scale, scale))
    values = np.maximum(values, SINGULAR)
    across = axes * scale[:, None]
    return np.asarray((across / values) @ across.T), float(np.sum(np.log(values)))


def shrinks(before: Fit, after: Fit) -> bool:
    """Whether the held-out RMS falls by more than ``SHRINKS_BY``."""
    return _gap_ratio(before, after) < 1 - SHRINKS_BY


def shrinks_or_predicts(before: Fit, after: Fit) -> bool:
    """Whether held-out RMS falls, or prediction improves while the RMS over the whole session is at most ``GROWS_BY``
    larger than it was, or than its noise floor was.

    Over the whole, for what is missing in a model may lie on the extreme speeds, which are in every fit: it misses them
    then, and hits those held out.
    """
    if shrinks(before, after):
        return True
    both = before.counted & after.counted
    was_mm, now_mm = gap_mm(before, both, whole=True), gap_mm(after, both, whole=True)
    grows = now_mm >= (1 + GROWS_BY) * max(was_mm, floor_mm(before, both, whole=True))
    return not grows and predictive_gain(before, after) > PREDICTS_NATS


def _gap_ratio(before: Fit, after: Fit) -> float:
    both = before.counted & after.counted
    return gap_mm(after, both) / gap_mm(before, both)


def squares_by_run(fit: Fit) -> dict[int, tuple[float, int]]:
    """Run → sum of squared held-out residuals, and their number."""
    counted = _counted(fit, None)
    residual_mm, run = held_out_residual_mm(fit)[counted], fit.run_index[counted]
    return {int(k): (float(np.sum(residual_mm[run == k] ** 2)), int(np.sum(run == k))) for k in np.unique(run)}


def shrinks_with(fit: Fit, columns: FloatArray) -> bool:
    """``shrinks`` by columns (m, k)."""
    prior = np.append(fit.prior, np.full(columns.shape[1], LEAST_PRECISION))
    return shrinks(fit, replace(fit, design=np.column_stack([fit.design, columns]), prior=prior))
