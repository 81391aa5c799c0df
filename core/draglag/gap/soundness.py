"""Whether the scatter that is left is the scatter of a sound rig: noise must not be a name for what is missing."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from draglag.gap.finding import Candidate
from draglag.gap.fit import Fit, log_likelihood_of
from draglag.gap.model import N_NUISANCES, base_prior
from draglag.gap.noise import TREMOR_MM_S, scatter

# What single edges scatter by on sound panels beyond the touch noise, from none to the most (generated sound sessions).
SOUND_EDGE_MM = (0.0, 0.05, 0.1)
SOUND_SPEED = (0.0, 0.005, 0.01, 0.02)
SOUND_UNEVEN = 0.1
# Twice the log-likelihood by which more scatter fits better; of 64 sound sessions one had 46, 0.02 an edge.
MOST = 100.0
MOST_PER_EDGE = 0.1
# The share of its latency by which the law may seem to follow another speed than the edge's: within ±0.2 and 3 standard
# errors of ±0.1 on as many sound sessions.
SHARE_MOST = 0.12


def excess_scatter(fit: Fit) -> Candidate | None:
    """The scatter of single edges where it is more than that of a sound rig, as a structure without a name."""
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    now = fit.whiteners[fit.best].components
    sound = [
        replace(now, edge_mm=edge, speed=speed, tremor_mm_s=tremor, uneven=SOUND_UNEVEN)
        for edge, speed, tremor in product(SOUND_EDGE_MM, SOUND_SPEED, TREMOR_MM_S)
    ]
    excess = 2 * (log_likelihood_of(fit, parts, now) - max(log_likelihood_of(fit, parts, c) for c in sound))
    if excess < MOST or excess < MOST_PER_EDGE * fit.use.sum():
        return None
    return Candidate(None, "scatter", "latency", float(excess), 1, 1, 0.0)


def follows_another_speed(fit: Fit) -> Candidate | None:
    """The law's speed lying clearly earlier or later than the edge's, as a structure without a name.

    The model grants a little of that (a nuisance with a prior of its own), and would hide a lot of it.
    """
    at = base_prior(fit.law).size - N_NUISANCES
    prior = fit.prior.copy()
    prior[at] = 1e-9
    white = fit.whiteners[fit.best]
    a, b = white.apply(fit.design), white.apply(fit.residual_mm)
    covariance = np.linalg.pinv(a.T @ a + np.diag(prior), hermitian=True)
    share, se = float(covariance[at] @ (a.T @ b)), float(np.sqrt(covariance[at, at]))
    if abs(share) - 3 * se < SHARE_MOST:
        return None
    return Candidate(None, "acceleration", "latency", (share / se) ** 2, 1, 1, 0.0)
