"""Penalty for edges that a hypothesis leaves open."""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr, logsumexp

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.model import residual_mm
from draglag.gap.fitting.noise import timing_mm
from draglag.gap.fitting.state import term_signature, total, view_with_terms
from draglag.gap.proposing.left_open import open_mm
from draglag.recording import FloatArray


def freedom_nats(fit: Fit, base: Fit) -> float:
    """Penalty for edges of ``base`` that a fit leaves open."""
    if fit.only is None or fit.use.size != base.use.size:
        return 0.0
    left = base.use & ~fit.only
    if not left.any():
        return 0.0
    residual, sd = _residual_mm(fit)[left], _sd_mm(fit)[left]
    good = np.isfinite(residual)
    width = np.maximum(open_mm(fit.placed, fit.terms)[left][good], 1e-6)
    given = _log_uniform(residual[good], sd[good], width)
    alone = -0.5 * (1 + np.log(2 * np.pi)) - np.log(sd[good])  # what noise alone has on the average
    return float(np.sum(alone - np.minimum(given, alone)))


def _log_uniform(residual_mm: FloatArray, sd_mm: FloatArray, width_mm: FloatArray) -> FloatArray:
    """Log density, uniform within ± width plus normal noise."""
    high, low = (residual_mm + width_mm) / sd_mm, (residual_mm - width_mm) / sd_mm
    flip = np.where(residual_mm > 0, -1.0, 1.0)  # in the tail where differences keep their digits
    a, b = np.where(flip > 0, high, -low), np.where(flip > 0, low, -high)
    both = np.stack([log_ndtr(a), log_ndtr(b)])
    inside = logsumexp(both, axis=0, b=np.array([[1.0], [-1.0]]))
    return np.asarray(inside - np.log(2 * width_mm))


def _residual_mm(fit: Fit) -> FloatArray:
    view = view_with_terms(fit.placed, fit.law, fit.geometry, fit.terms, fit.width_mm)
    signatures = tuple(term_signature(term, view) for term in fit.terms)
    out = residual_mm(fit.placed, fit.geometry) - total(signatures, fit.terms, view, "offset")
    return np.asarray(np.where(fit.placed.ok, out, np.nan))


def _sd_mm(fit: Fit) -> FloatArray:
    placed, levels = fit.placed, fit.white.components
    follows = placed.v_mm_s[:, 1] * placed.stretch * placed.slope_s2_mm
    variance = placed.touch_variance_mm2 + timing_mm(placed) ** 2 + levels.edge_mm**2 + levels.run_mm**2
    variance += (follows * np.hypot(levels.speed * placed.speed_mm_s, levels.tremor_mm_s)) ** 2
    return np.sqrt(variance + (levels.run_s * placed.v_mm_s[:, 1]) ** 2)
