"""The gap on runs held out of the fit, and the floor that noise alone would leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.noise import scatter
from draglag.gap.fitting.whitening import whitener
from draglag.recording import FloatArray, IntArray

FOLDS = 5
IN_EVERY_FIT = -1
LEAST_WHITE_GAIN = 12.0  # in −2 ln L of held-out residuals
NO_WORSE = 0.02
# Of −2 ln L an edge: beyond doubt, though a law fitted without one speed may miss that speed by a little more.
DECISIVE, A_LITTLE_WORSE = 0.5, 0.1
WORTH_A_NAME = 0.02  # of the gap: by less it has not shrunk


def folds(fit: Fit) -> IntArray:
    """Fold of each used edge: by run; replicates of one speed in different folds, neighbouring speeds too.

    A law cannot be asked beyond its speeds: where the slowest or the fastest was run only once it stays in every fit.
    """
    nominal = [data.run.nominal_speed_mm_s for data in fit.runs]
    steady = sorted((round(float(v), 1), k) for k, v in enumerate(nominal) if v is not None)
    fold_of_run = {k: place % FOLDS for place, (_, k) in enumerate(steady)}
    speeds = [v for v, _ in steady]
    if len(set(speeds)) > 4:
        fold_of_run |= {k: IN_EVERY_FIT for v, k in (steady[0], steady[-1]) if speeds.count(v) == 1}
    fold: IntArray = np.array([fold_of_run.get(k, k % FOLDS) for k in range(len(nominal))], np.int64)
    return np.asarray(fold[fit.run_index])


def held_out_residual_mm(fit: Fit) -> FloatArray:
    """Residual of every used edge under parameters fitted without its fold, mm."""
    fold = folds(fit)
    a, b = _white(fit)
    out = fit.residual_mm.copy()
    for k in np.unique(fold[fold != IN_EVERY_FIT]):
        train, test = fold != k, fold == k
        spread = _spread(fit, a[train])
        out[test] = fit.residual_mm[test] - fit.design[test] @ (spread @ (a[train].T @ b[train]))
    return out


def noise_variance_mm2(fit: Fit, granted: bool = False) -> FloatArray:
    """What noise alone leaves at every used edge, parameters fitted without its fold.

    That a run of changing speed may miss the law as a whole, and follow its own changes of speed unevenly, is granted
    by the fit, but it is no noise. granted: the second is counted all the same.
    """
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    noise_mm = parts.uneven_mm if granted else np.where(fit.placed.steady[fit.use], parts.uneven_mm, 0.0)
    parts = replace(parts, loose_s=np.zeros(len(fit.runs)), uneven_mm=noise_mm)
    variance = whitener(parts, fit.whiteners[fit.best].components).variance_mm2.copy()
    fold = folds(fit)
    a, _ = _white(fit)
    for k in np.unique(fold[fold != IN_EVERY_FIT]):
        test = fold == k
        variance[test] += np.einsum("ij,jk,ik->i", fit.design[test], _spread(fit, a[~test]), fit.design[test])
    return np.asarray(variance)


def _white(fit: Fit) -> tuple[FloatArray, FloatArray]:
    white = fit.whiteners[fit.best]
    return white.apply(fit.design), white.apply(fit.residual_mm)


def _spread(fit: Fit, design: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.pinv(design.T @ design + np.diag(fit.prior), hermitian=True))


def gap_mm(fit: Fit) -> float:
    """RMS residual on held-out runs, mm."""
    residual = held_out_residual_mm(fit)
    return float(np.sqrt(np.mean(residual[folds(fit) != IN_EVERY_FIT] ** 2)))


def clearly_less(after_mm: float, before_mm: float) -> bool:
    """Whether one gap is so much smaller than another that it is worth a name."""
    return after_mm < (1 - WORTH_A_NAME) * before_mm


def shrinks(before: Fit, after: Fit) -> bool:
    """Whether held-out runs fit better, run by run: the geometric mean of their RMS, which no single run decides."""
    return _change(before, after) < -2 * WORTH_A_NAME  # of the mean square


def _change(before: Fit, after: Fit) -> float:
    """Mean change of ln(mean square) of the held-out runs that both have."""

    def level(fit: Fit) -> dict[int, float]:
        residual = held_out_residual_mm(fit)
        held = folds(fit) != IN_EVERY_FIT
        runs = np.unique(fit.run_index[held])
        return {int(k): float(np.log(np.mean(residual[held & (fit.run_index == k)] ** 2) + 1e-9)) for k in runs}

    old, new = level(before), level(after)
    shared = old.keys() & new.keys()
    return sum(new[k] - old[k] for k in shared) / max(len(shared), 1)


def improves(before: Fit, after: Fit) -> bool:
    """Whether held-out runs speak for the model: they shrink, or weighed edge by edge they are likelier.

    What moves few edges, or all of them a little, hardly shows in an RMS.
    """
    change = _change(before, after)
    if change < -2 * WORTH_A_NAME:
        return True
    each = white_level(before) - white_level(after)
    if each > DECISIVE and change < A_LITTLE_WORSE:
        return True
    return change < NO_WORSE and each * min(before.residual_mm.size, after.residual_mm.size) > LEAST_WHITE_GAIN


def white_level(fit: Fit) -> float:
    """−2 ln L an edge of the held-out residuals under the fit's own noise."""
    residual = held_out_residual_mm(fit)
    white = fit.whiteners[fit.best]
    return (float(np.sum(white.apply(residual) ** 2)) + white.log_det) / residual.size


def shrinks_with(fit: Fit, columns: FloatArray) -> bool:
    """The same for columns that are added to the linear model, an effect without a name."""
    prior = np.append(fit.prior, np.full(columns.shape[1], 1e-12))
    return shrinks(fit, replace(fit, design=np.column_stack([fit.design, columns]), prior=prior))


def floor_mm(fit: Fit, granted: bool = False) -> float:
    """RMS that noise alone leaves on held-out runs, mm; granted: with what runs of changing speed follow unevenly."""
    return float(np.sqrt(np.mean(noise_variance_mm2(fit, granted)[folds(fit) != IN_EVERY_FIT])))
