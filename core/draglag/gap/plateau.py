"""How surely a plateau's speed is known: its likelihood profile, the rest of the law at its best for each speed.

Between the fastest run below and the slowest above it the law is seen by nobody. Whether it bends there is open to the
rates, and the curvature at the best point alone states an error that is too small.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import t as student

from draglag.gap.fit import Fit
from draglag.gap.model import LEAST_AMPLITUDE_S
from draglag.recording import FloatArray

RATES_S_MM = np.geomspace(0.001, 0.06, 20)
REACH = np.geomspace(0.7, 1.4, 57)  # of the best speed
N_LAW = 6


def plateau_ci95_mm_s(fit: Fit) -> tuple[float, float]:
    """95 % interval of the fit's plateau speed, never narrower than the one from the curvature at its best.

    What differs from run to run is sized by the runs that the law leaves over: Student's t instead of the normal's, and
    the likeliest size of it is too small by as much as the law has taken up.
    """
    best = fit.law.plateau_mm_s
    n_runs = np.unique(fit.run_index).size
    over = max(n_runs - N_LAW, 3)
    wide = float(student.ppf(0.975, over) * np.sqrt(n_runs / over))
    reach = wide * float(np.sqrt(max(fit.covariance[5, 5], 0.0)))
    speeds = best * REACH
    gain = _profile(fit, speeds)
    likely = speeds[gain >= gain.max() - wide**2]
    if not likely.size:
        return best - reach, best + reach
    return min(float(likely[0]), best - reach), max(float(likely[-1]), best + reach)


def _profile(fit: Fit, plateaus_mm_s: FloatArray) -> FloatArray:
    """Twice the log-likelihood, up to a constant, of each plateau speed (k,)."""
    white = fit.whiteners[fit.best]
    placed, use = fit.placed, fit.use
    v_n = placed.v_mm_s[use, 1] * placed.stretch[use]
    speed = placed.speed_mm_s[use]
    whole = white.apply(np.column_stack([fit.residual_mm - v_n * fit.law(speed), -v_n, fit.design[:, N_LAW:]]))
    calm = 1 / np.sqrt(np.maximum(1.0, np.abs(white.apply(fit.residual_mm)) / 4))[:, None]
    target, others = whole[:, 0] * calm[:, 0], whole[:, 1:] * calm
    spread = np.linalg.pinv(others.T @ others + np.diag(np.concatenate([[1e-9], fit.prior[N_LAW:]])), hermitian=True)
    moment = others.T @ target
    own = float(moment @ spread @ moment)
    i, j = np.triu_indices(RATES_S_MM.size, 1)
    out = np.empty(plateaus_mm_s.size)
    for k, plateau in enumerate(plateaus_mm_s):
        held = np.maximum(speed, plateau)
        slow = white.apply(-v_n[:, None] * np.exp(-held[:, None] * RATES_S_MM)) * calm
        cross = others.T @ slow
        gram = slow.T @ slow - cross.T @ spread @ cross
        pull = slow.T @ target - cross.T @ spread @ moment
        determinant = gram[i, i] * gram[j, j] - gram[i, j] ** 2 + 1e-18
        one = (gram[j, j] * pull[i] - gram[i, j] * pull[j]) / determinant
        two = (gram[i, i] * pull[j] - gram[i, j] * pull[i]) / determinant
        value = np.where(np.minimum(one, two) >= LEAST_AMPLITUDE_S, one * pull[i] + two * pull[j], -np.inf)
        single = np.where(pull > 0, pull**2 / np.diag(gram), -np.inf)  # one rate alone is a law, too
        out[k] = own + max(float(value.max()), float(single.max()))
    return out
