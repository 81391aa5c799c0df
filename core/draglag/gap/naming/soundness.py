"""Whether the scatter that is left is the scatter of a sound rig: noise must not be a name for what is missing."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.stats import chi2

from draglag.gap.finding.scan import LEVEL, Candidate
from draglag.gap.fitting.joint import RIPPLE, Fit, log_likelihood_of
from draglag.gap.fitting.model import N_NUISANCES, base_prior
from draglag.gap.fitting.noise import RUN_S, TREMOR_MM_S, scatter
from draglag.gap.fitting.whitening import whitener
from draglag.gap.naming.tries import shown_ripple
from draglag.simulation.effects import effect_class

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
# Between runs, beyond what panels differ by from run to run; on 40 sound sessions it never fitted better.
WIDER_S = (0.002, 0.004, 0.008)
MOST_BETWEEN = 20.0

SEEN = 0.3  # of the best seen combination of levels: the curve takes up most of what is less
BY_TURN = 0.7  # of what runs differ by


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


def excess_between_runs(fit: Fit) -> Candidate | None:
    """What whole runs differ by where it is more than panels differ by from run to run; "turn" if those one way round
    differ from those the other way, else "run"."""
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    now = fit.whiteners[fit.best].components
    wider = [replace(now, run_s=run_s) for run_s in WIDER_S]
    excess = 2 * (max(log_likelihood_of(fit, parts, c) for c in wider) - log_likelihood_of(fit, parts, now))
    off, p_value = off_the_curve(fit)
    if excess < MOST_BETWEEN and p_value > LEVEL:
        return None
    return Candidate(None, "turn" if _follows_turn(fit) else "run", "latency", max(float(excess), off), 1, 1, 0.0)


def off_the_curve(fit: Fit) -> tuple[float, float]:
    """χ² of the runs' own latencies about the fitted curve, and the smaller of the probabilities of it and of its
    largest part, if panels differed from run to run by the most that they do; 0 and 1 where no run has any.

    A curve of another shape than Eq. 5 leaves runs on either side of it, one or two at each speed; one of another
    shape near one speed leaves a single run. Taken for a random latency of each run, that is no more than twice as wide
    as can be, and yet it is not chance.
    """
    steady = [k for k in np.unique(fit.run_index) if fit.runs[k].steady]
    own = (fit.run_index[:, None] == steady) * fit.view.v_across[:, None]
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    white = whitener(parts, replace(fit.whiteners[fit.best].components, run_s=max(RUN_S)))
    # What is sought has a weak prior of its own: rows of it below those of the edges.
    prior = np.diag(np.sqrt(fit.prior))
    model, _ = np.linalg.qr(np.vstack([white.apply(fit.design), prior]))
    both = np.vstack([white.apply(np.column_stack([own, fit.residual_mm])), np.zeros((len(prior), len(steady) + 1))])
    left = both - model @ (model.T @ both)
    levels, size, _ = np.linalg.svd(left[:, :-1], full_matrices=False)
    told = size > SEEN * size.max(initial=0.0)
    if not told.any():
        return 0.0, 1.0
    off = float(np.sum((levels[:, told].T @ left[:, -1]) ** 2))
    length = np.linalg.norm(left[:, :-1], axis=0)
    seen = length > SEEN * size.max()
    alone = left[:, :-1].T[seen] @ left[:, -1] / length[seen]
    one = alone.size * float(chi2.sf(np.max(alone**2, initial=0.0), 1))
    return off, min(float(chi2.sf(off, np.count_nonzero(told))), one)


def _follows_turn(fit: Fit) -> bool:
    placed, use = fit.placed, fit.use
    late, way = [], []
    for k, data in enumerate(fit.runs):
        own = fit.run_index == k
        if not data.steady or not own.any():
            continue
        v, a = placed.v_mm_s[use][own], placed.a_mm_s2[use][own]
        across = fit.view.v_across[own]
        late.append(float(across @ fit.residual_mm[own] / max(across @ across, 1e-9)))
        way.append(bool(np.median(v[:, 0] * a[:, 1] - v[:, 1] * a[:, 0]) > 0))
    each = [np.array(late)[np.array(way, bool) == one] for one in (False, True)]
    if min(group.size for group in each) < 2:
        return False
    within = sum(float(np.sum((group - group.mean()) ** 2)) for group in each)
    return within < (1 - BY_TURN) * float(np.sum((np.array(late) - np.mean(late)) ** 2))


def nameless_ripple(fit: Fit) -> Candidate | None:
    """A ripple that the touch events show, large enough for a name, where it may have none; edges show it less."""
    if shown_ripple(fit) is None:
        return None
    return Candidate(None, effect_class(RIPPLE).follows, "offset", 0.0, 1, 1, 0.0)


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
