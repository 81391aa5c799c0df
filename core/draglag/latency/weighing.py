"""Generalised least squares of a run's edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dpbtrf, dtbtrs

from draglag.path.events import median
from draglag.recording import FloatArray

SPEED_SLOPE_SD_S = 0.16  # prior on dL/d(ln v): spans every published curve; keeps uneven speed from biasing L
SCATTER_MM = np.concatenate([[0.0], 0.01 * 1.6 ** np.arange(15)])
SCATTER_LOG_PRIOR = np.log(np.append(15.0, np.ones(15)))  # as likely none as any, and then of any size


@dataclass(frozen=True)
class Known:
    """Covariances of the edges as lower bands, (b, m): known part, form of the unknown part."""

    bands: FloatArray
    extra: FloatArray

    @property
    def variance(self) -> FloatArray:
        return np.asarray(self.bands[0])

    @cached_property
    def factor(self) -> FloatArray:
        return _factor(self.bands.copy(order="F"))


@dataclass(frozen=True)
class Fit:
    estimate: FloatArray
    spread: FloatArray
    residual: FloatArray
    tau_mm: float
    p_no_scatter: float
    log_likelihood: float


def _factor(bands: FloatArray) -> FloatArray:
    factor, bad = dpbtrf(bands, lower=1, overwrite_ab=1)
    if bad:
        raise np.linalg.LinAlgError("the edges' covariance is not positive definite")
    return np.asarray(factor)


def _scaled(design: FloatArray, response: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    scale = np.sqrt(np.einsum("mp,mp->p", design, design) / design.shape[0]) + 1e-12
    prior = np.zeros((5, 5))
    prior[4, 4] = (scale[4] ** -2) / SPEED_SLOPE_SD_S**2
    both = np.empty((design.shape[0], 6), order="F")
    np.divide(design, scale, out=both[:, :5])
    both[:, 5] = response
    return scale, prior, both


def known_fit(design: FloatArray, response: FloatArray, known: Known) -> tuple[FloatArray, FloatArray]:
    """Estimate (5,) and residual (m,) without extra scatter."""
    scale, prior, both = _scaled(design, response)
    white = dtbtrs(known.factor, both, uplo="L")[0]
    gram = white.T @ white
    estimate = np.linalg.solve(gram[:5, :5] + prior, gram[:5, 5]) / scale
    return estimate, response - design @ estimate


def weighted_fit(design: FloatArray, response: FloatArray, known: Known, scatter_mm: FloatArray = SCATTER_MM) -> Fit:
    """Generalised least squares, averaged over the extra scatter τ by restricted likelihood."""
    scale, prior, both = _scaled(design, response)
    grams, log_dets = np.empty((scatter_mm.size, 6, 6)), np.empty(scatter_mm.size)
    for k, tau in enumerate(scatter_mm):
        factor = _factor(known.bands + tau**2 * known.extra) if tau else known.factor
        white = dtbtrs(factor, both, uplo="L")[0]
        grams[k] = white.T @ white
        log_dets[k] = np.log(factor[0]).sum()
    normal, moment = grams[:, :5, :5] + prior, grams[:, :5, 5]
    spreads = np.linalg.inv(normal)
    estimates = np.einsum("tpq,tq->tp", spreads, moment)
    chi2 = grams[:, 5, 5] - (moment * estimates).sum(1)
    value = SCATTER_LOG_PRIOR[: scatter_mm.size] - 0.5 * chi2 - log_dets - 0.5 * np.linalg.slogdet(normal)[1]
    # The mean over τ, by its probability: the best τ alone is often 0, and its interval then too short.
    share = np.exp(value - value.max())
    total = float(share.sum())
    share /= total
    mean = share @ estimates
    deviation = estimates - mean
    together = np.einsum("t,tpq->pq", share, spreads) + (deviation * share[:, None]).T @ deviation
    best = mean / scale
    return Fit(
        best,
        together / np.outer(scale, scale),
        response - design @ best,
        float(np.sqrt(share @ scatter_mm**2)),
        float(share[0]),
        float(value.max()) + float(np.log(total)),
    )


def likely_scatter_mm(residual: FloatArray) -> FloatArray:
    """The scatters τ of non-negligible weight: beyond three times the residuals the likelihood falls as τ^(m/2 − 5)."""
    beyond = 25.0 / (np.log(1.6) * max(0.5 * residual.size - 5, 1.0))
    size = int(np.searchsorted(SCATTER_MM, 3 * np.sqrt(np.mean(residual**2))))
    return SCATTER_MM[: size + 1 + int(np.ceil(beyond))]


def outliers(residual: FloatArray, variance: FloatArray) -> np.ndarray:
    """Edges no stylus made: beyond 5 robust standard deviations, at most a fifth."""
    scale = 1.4826 * median(np.abs(residual - median(residual)))
    limit = 5 * np.maximum(np.sqrt(variance), scale)
    out = np.abs(residual) > limit
    if np.count_nonzero(out) > 0.2 * residual.size:
        worst = np.argsort(-np.abs(residual / limit))[: int(0.2 * residual.size)]
        out = np.zeros_like(out)
        out[worst] = True
    return out
