"""A latency that wanders smoothly, in the edges: the rival of two lasting levels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.recording import FloatArray

LENGTHS_S = (2.0, 4.0, 8.0, 16.0)
"""s. Over which a wandering latency changes. Physical: faster is noise of single edges, slower a level of its run."""
SIZES_S = (0.001, 0.002, 0.004, 0.008, 0.016)
"""s. Standard deviation of a wandering latency. Physical: twice what runs of a panel differ by, to a tick."""
SCATTERS = (1.0, 2.0, 4.0, 8.0, 16.0)
"""How many times as much as their own error edges may scatter about either course. Derived: factors of two."""
FARTHEST = 25.0
"""Squared standard deviations of an edge, beyond which it counts for no more: something else has made it. Judgement."""

Course = tuple[FloatArray, FloatArray, FloatArray]
"""Times (m,) of one run's edges, rising, their lateness, and its standard deviation, all in s."""


def log_likelihood_of_wandering(courses: Sequence[Course]) -> float:
    """Log-likelihood of the courses as Gaussian processes (Matérn 3/2) about each run's mean, at the likeliest length,
    size and scatter of them all. Source: Hartikainen & Särkkä 2010, as a Kalman filter.
    """
    longest = max(t_s.size for t_s, _, _ in courses)
    step_s, late_s = np.zeros((2, longest, len(courses)))
    sd_s = np.full((longest, len(courses)), np.inf)  # says nothing
    for k, (t_s, own_s, own_sd_s) in enumerate(courses):
        weight = own_sd_s**-2
        step_s[1 : t_s.size, k] = np.diff(t_s)
        late_s[: t_s.size, k] = own_s - weight @ own_s / weight.sum()
        sd_s[: t_s.size, k] = own_sd_s
    length_s, size_s, scatter = (grid.ravel()[:, None] for grid in np.meshgrid(LENGTHS_S, SIZES_S, SCATTERS))
    return float(_filtered(step_s, late_s, sd_s, np.sqrt(3) / length_s, size_s**2, scatter).sum(axis=1).max())


def _filtered(
    step_s: FloatArray,
    late_s: FloatArray,
    sd_s: FloatArray,
    rate: FloatArray,
    variance: FloatArray,
    scatter: FloatArray,
) -> FloatArray:
    """Log-likelihood (settings, runs). step_s, late_s, sd_s: (m, runs); rate, variance, scatter: (settings, 1)."""
    shape = np.broadcast_shapes(rate.shape, step_s[0].shape)
    value, slope, total = np.zeros((3, *shape))
    vv, vs, ss = np.broadcast_to(variance, shape), np.zeros(shape), np.broadcast_to(rate**2 * variance, shape)
    for dt_s, y_s, sd in zip(step_s, late_s, sd_s, strict=True):
        fade = np.exp(-rate * dt_s)
        a, b, c, d = fade * (1 + rate * dt_s), fade * dt_s, -fade * rate**2 * dt_s, fade * (1 - rate * dt_s)
        value, slope = a * value + b * slope, c * value + d * slope
        # The prior's covariance P is stationary: F (Σ − P) Fᵀ + P.
        xv, xs = vv - variance, ss - rate**2 * variance
        vv, vs, ss = (
            a * a * xv + 2 * a * b * vs + b * b * xs + variance,
            a * c * xv + (a * d + b * c) * vs + b * d * xs,
            c * c * xv + 2 * c * d * vs + d * d * xs + rate**2 * variance,
        )
        known = np.isfinite(sd)
        noise = np.where(known, scatter * sd, 1.0) ** 2
        off_s, whole = y_s - value, vv + noise
        z2 = off_s**2 / whole
        total += np.where(known, -0.5 * np.minimum(z2, FARTHEST) - 0.5 * np.log(whole * scatter**2 / noise), 0.0)
        gain = np.where(known & (z2 < FARTHEST), 1 / whole, 0.0)
        value, slope = value + gain * vv * off_s, slope + gain * vs * off_s
        vv, vs, ss = vv - gain * vv * vv, vs - gain * vv * vs, ss - gain * vs * vs
    return np.asarray(total)
