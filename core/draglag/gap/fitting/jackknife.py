"""Standard deviation of a fit's numbers by the jackknife over runs, whatever its noise model."""

from __future__ import annotations

import numpy as np

from draglag.gap.fitting.joint import Fit
from draglag.recording import FloatArray

ALONE = 10.0  # times the variance without a run: it alone knows the number
LEAST_RUNS = 5  # of a jackknife


def jackknife_sd(fit: Fit) -> FloatArray:
    """Standard deviation of every number of the linear model as the runs themselves show it, (p,): the jackknife that
    leaves out one run at a time (Efron & Stein 1981). A run without which a number is undefined is left out.

    The fit's covariance knows of runs only its components; a latency that follows the place or the hour from
    run to run, or noise that lasts for a whole pass, is in here too. Zero with too few runs.
    """
    white = fit.white
    a, b = white.apply(fit.design), white.apply(fit.residual_mm)
    information, moment = a.T @ a + np.diag(fit.prior), a.T @ b
    spread = np.linalg.pinv(information, hermitian=True)
    each = [(a[own].T @ a[own], a[own].T @ b[own]) for own in (fit.run_index == k for k in np.unique(fit.run_index))]
    less, moved = (np.array(parts) for parts in zip(*each, strict=True))
    without = np.linalg.pinv(information - less, hermitian=True)
    off = np.einsum("rpq,rq->rp", without, moment - moved) - spread @ moment
    known = np.diagonal(without, axis1=1, axis2=2) < ALONE * np.diag(spread)
    telling = np.sum(known, axis=0)
    square = np.sum(np.where(known, off, 0.0) ** 2, axis=0) * (telling - 1) / np.maximum(telling, 1)
    return np.asarray(np.where(telling >= LEAST_RUNS, np.sqrt(np.maximum(square, 0.0)), 0.0))
