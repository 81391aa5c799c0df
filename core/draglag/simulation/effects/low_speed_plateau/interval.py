"""Interval of a plateau's speed by profile likelihood; between two runs' speeds curvature understates it."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.rates import pairs_at, without_law
from draglag.recording import FloatArray

RATES_S_MM = np.geomspace(0.001, 0.06, 20)
REACH = np.geomspace(0.7, 1.4, 57)  # of the best speed
N_LAW = 6  # parameters of Eq. 5 with a plateau


def plateau_ci95_mm_s(fit: Fit) -> tuple[float, float]:
    """95 % interval, at least that from curvature; Student's t for the estimated scatter between runs."""
    best = fit.law.plateau_mm_s
    n_runs = np.unique(fit.run_index).size
    over = max(n_runs - N_LAW, 3)
    wide = float(stdtrit(over, 0.975) * np.sqrt(n_runs / over))
    reach = wide * float(np.sqrt(max(fit.covariance[5, 5], 0.0)))
    speeds = best * REACH
    gain = _profile(fit, speeds)
    likely = speeds[gain >= gain.max() - wide**2]
    if not likely.size:
        return best - reach, best + reach
    return min(float(likely[0]), best - reach), max(float(likely[-1]), best + reach)


def _profile(fit: Fit, plateaus_mm_s: FloatArray) -> FloatArray:
    """Twice the log-likelihood of each plateau speed (k,)."""
    placed, use = fit.placed, fit.use
    v_n = placed.v_mm_s[use, 1] * placed.stretch[use]
    n_law = N_LAW if fit.law.plateau_mm_s > 0 else N_LAW - 1
    rest, prior = fit.design[:, n_law:], fit.prior[n_law:]
    white = fit.white
    used = without_law(fit.law, placed.speed_mm_s[use], v_n, fit.residual_mm, rest, prior, white)
    at = (pairs_at(used, float(plateau), RATES_S_MM) for plateau in plateaus_mm_s)
    return np.array([max(float(pairs.gain.max()), pairs.alone) for pairs in at])
