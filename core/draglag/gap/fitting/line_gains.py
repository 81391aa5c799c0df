"""Gain of pairs of columns on a fit's residual."""

from __future__ import annotations

import numpy as np

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.noise import Scatter
from draglag.gap.fitting.whitening import whitened_columns
from draglag.recording import FloatArray
from draglag.simulation.residual import LineGains


def line_gains(fit: Fit, parts: Scatter) -> LineGains:
    """Function of columns (m, 2 k): gain of each pair, (k,)."""
    white = fit.white
    design = np.vstack([white.apply(fit.design), np.diag(np.sqrt(fit.prior))])
    target = np.append(white.apply(fit.residual_mm), np.zeros(fit.prior.size))
    left = fit.residual_mm - fit.design @ np.linalg.lstsq(design, target, rcond=None)[0]

    def gains(columns: FloatArray) -> FloatArray:
        x, common = whitened_columns(parts, white.components, np.column_stack([columns, left]))
        taken = common.rows(white.components)[0]
        moment = (x.T @ x[:, -1] - taken.T @ taken[:, -1])[:-1].reshape(-1, 2)
        size = (np.sum(x**2, axis=0) - np.sum(taken**2, axis=0))[:-1].reshape(-1, 2)
        return np.asarray(np.sum(moment**2 / np.maximum(size, 1e-12), axis=1), float)

    return gains
