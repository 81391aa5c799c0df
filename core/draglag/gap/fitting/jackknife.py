"""Jackknife over runs, valid for any noise model."""

from __future__ import annotations

import numpy as np

from draglag.gap.constants import FEWEST_RUNS
from draglag.gap.fitting.joint import Fit
from draglag.recording import FloatArray

ALONE = 10.0  # times the variance without a run: it alone knows the number. Judgement


def jackknife_sd(fit: Fit) -> FloatArray:
    """Standard deviation of each linear parameter, (p,) (Efron & Stein 1981); zero with few runs.

    Runs without which it is undefined are skipped.
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
    return np.asarray(np.where(telling >= FEWEST_RUNS, np.sqrt(np.maximum(square, 0.0)), 0.0))
