"""What the residuals scatter by when nothing is missing: touch noise, single edges, whole runs.

Touch noise is known from the trace itself and is shared by edges whose windows overlap; it enters twice, through the
position and through the speed at which the law is evaluated. On top come a scatter of single edges (τ), and a random
latency and a random offset of each run. Those three are estimated, over a grid, by the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import cho_factor, solve_triangular

from draglag.gap.edges import Placed, RunData, sparse_rows
from draglag.recording import FloatArray

EDGE_MM = (0.0, 0.05, 0.1, 0.2, 0.4)
SPEED = (0.0, 0.01, 0.02, 0.04)
UNEVEN = (0.1, 0.3)
RUN_S = (0.0, 0.0005, 0.001)  # panels differ by about 0.7 ms from run to run; more is not noise but something missing
RUN_MM = (0.0, 0.05)
SPEED_TIMING_S = 0.01  # a speed read from a window of 50–250 ms is not known to better than this in time
UNSTEADY = 0.2  # share of a chirp's or step's own range of latency by which its level may miss the law's
ACCEL_MEMORY_S = 0.08  # half the span that an acceleration is taken over
SPEED_MEMORY_S = 0.15  # how long the hand's own unevenness, faster than the speed window, lasts


@dataclass(frozen=True)
class Components:
    """Standard deviations beyond the touch noise.

    edge_mm: single edges. speed: relative error of the speed the law is evaluated at. uneven: share by which a run's
    latency follows its own changes of speed more or less than the law does from run to run. run_s, run_mm: a random
    latency and a random offset of each run.
    """

    edge_mm: float
    speed: float
    uneven: float
    run_s: float
    run_mm: float


LOCAL = (("edge_mm", EDGE_MM), ("speed", SPEED), ("uneven", UNEVEN))
BETWEEN = tuple(product(RUN_S, RUN_MM))


def touch_covariances(runs: tuple[RunData, ...], placed: Placed, use: np.ndarray) -> list[FloatArray]:
    """Covariance (mm²) of the used edges of each run from the touch noise alone."""
    out = []
    for k, data in enumerate(runs):
        own = placed.run == k
        keep = use[own]
        position, fast = placed.position_fit[k], placed.speed_fit[k]
        velocity = placed.v_mm_s[own]
        shown = np.maximum(np.hypot(velocity[:, 0], velocity[:, 1]), 1e-6)
        # A speed error moves L by L′ and the edge by v_n L′; direction cosines of the motion split it by axis.
        leverage = velocity[:, 1] * placed.slope_s2_mm[own] * placed.stretch[own]
        along_y, along_x = velocity[:, 1] / shown, velocity[:, 0] / shown
        n = data.t_s.size
        place_y = sparse_rows(position.first, position.weights, n)
        rate = sparse_rows(fast.first, fast.v_weights, n)
        across = place_y + rate.multiply((leverage * along_y)[:, None]).tocsr()
        beside = rate.multiply((leverage * along_x)[:, None]).tocsr()
        across, beside = across[keep], beside[keep]
        out.append(data.noise_mm**2 * (across @ across.T + beside @ beside.T).toarray())
    return out


@dataclass(frozen=True)
class Whitener:
    """Cholesky factors of one grid point: ``apply`` makes residuals white; ``log_det`` is ln |C|."""

    components: Components
    factors: tuple[FloatArray, ...]
    slices: tuple[slice, ...]
    log_det: float

    def apply(self, values: FloatArray) -> FloatArray:
        """Whiten (m,) or (m, k)."""
        out = np.empty_like(values, dtype=float)
        for factor, own in zip(self.factors, self.slices, strict=True):
            out[own] = solve_triangular(factor, values[own], lower=True, check_finite=False)
        return out


@dataclass(frozen=True)
class Scatter:
    """What a covariance is made of, for the used edges (m,): touch blocks by run, velocity across, what a relative
    error of the speed does to the residual (mm), what a smoothed speed's own lag does to it (mm), what following the
    run's changes of speed twice would do to it (mm), and time; loose_s (runs,): by how much a run of changing speed may
    miss the law as a whole, for its dynamics are not the law's; blur_mm: what effects that follow the acceleration
    leave because the acceleration itself is only estimated."""

    touch: list[FloatArray]
    across_mm_s: FloatArray
    speed_lever_mm: FloatArray
    timing_mm: FloatArray
    uneven_mm: FloatArray
    t_s: FloatArray
    loose_s: FloatArray
    blur_mm: FloatArray


def scatter(runs: tuple[RunData, ...], placed: Placed, use: np.ndarray, blur_mm: FloatArray) -> Scatter:
    """Collect them from a placing. blur_mm: over all placed edges."""
    across = placed.v_mm_s[:, 1]
    lever = across * placed.stretch * placed.slope_s2_mm * placed.speed_mm_s
    timing = across * placed.stretch * placed.slope_s2_mm * placed.accel_mm_s2 * SPEED_TIMING_S
    uneven = across * placed.stretch * placed.slope_s2_mm * placed.speed_mm_s
    loose = np.zeros(len(runs))
    for k, data in enumerate(runs):
        own = use & (placed.run == k)
        if own.any():
            mean = placed.speed_mm_s[own].mean()
            uneven[own] *= 1 - mean / placed.speed_mm_s[own]
            loose[k] = 0.0 if data.steady else UNSTEADY * float(np.std(placed.latency_s[own]))
    touch = touch_covariances(runs, placed, use)
    return Scatter(touch, across[use], lever[use], timing[use], uneven[use], placed.t_s[use], loose, blur_mm[use])


def whitener(parts: Scatter, components: Components) -> Whitener:
    """Factor C = touch + τ² I + speed error + uneven following + run latency + run offset, block by run."""
    factors, slices, log_det, at = [], [], 0.0, 0
    for touch, loose_s in zip(parts.touch, parts.loose_s.tolist(), strict=True):
        m = touch.shape[0]
        own = slice(at, at + m)
        at += m
        v, lever, t = parts.across_mm_s[own], parts.speed_lever_mm[own], parts.t_s[own]
        c = touch + np.diag(components.edge_mm**2 + 1e-6 + parts.timing_mm[own] ** 2)
        c += (components.run_s**2 + loose_s**2) * np.outer(v, v) + components.run_mm**2
        if components.uneven > 0:
            c += components.uneven**2 * np.outer(parts.uneven_mm[own], parts.uneven_mm[own])
        blur = parts.blur_mm[own]
        if blur.any():
            c += np.outer(blur, blur) * np.exp(-np.abs(t[:, None] - t[None, :]) / ACCEL_MEMORY_S)
        if components.speed > 0:
            memory = np.exp(-np.abs(t[:, None] - t[None, :]) / SPEED_MEMORY_S)
            c += components.speed**2 * np.outer(lever, lever) * memory
        factor = np.tril(cho_factor(c, lower=True, check_finite=False)[0])
        log_det += 2 * float(np.sum(np.log(np.diag(factor))))
        factors.append(factor)
        slices.append(own)
    return Whitener(components, tuple(factors), tuple(slices), log_det)
