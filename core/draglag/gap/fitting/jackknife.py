"""Jackknife over runs, valid for any noise model."""

from __future__ import annotations

import numpy as np

from draglag.gap.constants import FEWEST_RUNS
from draglag.gap.fitting.joint import Fit
from draglag.recording import FloatArray


def jackknife_sd(fit: Fit) -> FloatArray:
    """Standard deviation of each linear parameter, (p,); zero with few runs.

    Each run weighs by the share of the information that is left without it (Wu 1986): where one knows most of a number,
    the plain jackknife takes the others' ignorance for scatter.
    """
    white = fit.white
    a, b = white.apply(fit.design), white.apply(fit.residual_mm)
    information, moment = a.T @ a + np.diag(fit.prior), a.T @ b
    spread = np.linalg.pinv(information, hermitian=True)
    each = [(a[own].T @ a[own], a[own].T @ b[own]) for own in (fit.run_index == k for k in np.unique(fit.run_index))]
    if len(each) < FEWEST_RUNS:
        return np.zeros(fit.design.shape[1])
    less, moved = (np.array(parts) for parts in zip(*each, strict=True))
    without = np.linalg.pinv(information - less, hermitian=True)
    off = np.einsum("rpq,rq->rp", without, moment - moved) - spread @ moment
    known, left = np.diag(spread), np.diagonal(without, axis1=1, axis2=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(left >= known, known / left, 0.0)  # no less than before, but where nothing is left to invert
    return np.asarray(np.sqrt(np.sum(share * off**2, axis=0)))
