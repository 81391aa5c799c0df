"""What a fit's nuisances move edges by: the speed that a law follows, and the bend of local fits."""

from __future__ import annotations

import numpy as np

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.model import nuisances
from draglag.recording import FloatArray


def late_by_nuisances_s(fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Mean lateness of each run's edges by the nuisances, and its standard error, (runs,); 0 without edges.

    The error includes what terms leave unsure, as the state of a filter about its switch, alike for a run's edges.
    """
    own = nuisances(fit.law)
    whitened = fit.white.apply(np.column_stack([fit.design, fit.residual_mm]))
    sizes = fit.covariance[own] @ (whitened[:, :-1].T @ whitened[:, -1])
    lever_mm_s = fit.view.v_across * fit.view.stretch
    weight = np.maximum(np.bincount(fit.run_index, lever_mm_s**2, len(fit.runs)), 1e-12)
    # Latencies weigh edges by their speed across the beam.
    late_s = np.column_stack(
        [np.bincount(fit.run_index, -column * lever_mm_s, len(fit.runs)) / weight for column in fit.design[:, own].T]
    )
    unsure_s2 = np.bincount(fit.run_index, fit.blur_mm[fit.use] ** 2, len(fit.runs)) / weight
    return late_s @ sizes, np.sqrt(unsure_s2 + np.einsum("ij,jk,ik->i", late_s, fit.covariance[own, own], late_s))
