"""The gap on runs held out of the fit, and the floor that noise alone would leave."""

from __future__ import annotations

import numpy as np

from draglag.gap.fit import Fit
from draglag.recording import FloatArray

FOLDS = 5


def folds(fit: Fit) -> np.ndarray:
    """Fold of each used edge: by run, replicates of one speed never apart, speeds dealt out in turn."""
    speeds = []
    for data in fit.runs:
        nominal = data.run.nominal_speed_mm_s
        speeds.append(-1.0 if nominal is None else round(float(nominal), 1))
    order = {speed: k for k, speed in enumerate(sorted(set(s for s in speeds if s >= 0)))}
    fold_of_run = [order[s] % FOLDS if s >= 0 else k % FOLDS for k, s in enumerate(speeds)]
    return np.array(fold_of_run)[fit.run_index]


def held_out_residual_mm(fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Residual of every used edge under parameters fitted without its fold, and its expected variance (mm²)."""
    fold = folds(fit)
    white = fit.whiteners[fit.best]
    a, b = white.apply(fit.design), white.apply(fit.residual_mm)
    out = fit.residual_mm.copy()
    variance = np.concatenate([np.einsum("ij,ij->i", f, f) for f in white.factors])
    for k in np.unique(fold):
        train, test = fold != k, fold == k
        spread = np.linalg.pinv(a[train].T @ a[train] + np.diag(fit.prior), hermitian=True)
        step = spread @ (a[train].T @ b[train])
        out[test] = fit.residual_mm[test] - fit.design[test] @ step
        variance[test] += np.einsum("ij,jk,ik->i", fit.design[test], spread, fit.design[test])
    return out, variance


def gap_mm(fit: Fit) -> float:
    """RMS residual on held-out runs, mm."""
    residual, _ = held_out_residual_mm(fit)
    return float(np.sqrt(np.mean(residual**2)))


def floor_mm(fit: Fit) -> float:
    """RMS that the noise alone leaves on held-out runs, mm."""
    _, variance = held_out_residual_mm(fit)
    return float(np.sqrt(np.mean(variance)))
