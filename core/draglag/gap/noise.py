"""What the residuals scatter by when nothing is missing: touch noise, single edges, whole runs.

Touch noise is known from the trace itself and is shared by edges whose windows overlap; it enters twice, through the
position and through the speed at which the law is evaluated. On top come a scatter of single edges (τ), and a random
latency and a random offset of each run. Those three are estimated, over a grid, by the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.sparse import csr_matrix

from draglag.gap.edges import Placed, RunData, sparse_rows
from draglag.recording import FloatArray

EDGE_MM = (0.0, 0.05, 0.1, 0.2, 0.4)
SPEED = (0.0, 0.01, 0.02, 0.04)
UNEVEN = (0.1, 0.3)
# Panels differ by about 0.7 ms from run to run; more is not noise but something missing.
RUN_S = (0.0, 0.00025, 0.0005, 0.001)
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
        across, beside = (rows[use[placed.run == k]] for rows in _touch_rows(data, placed, k))
        out.append(data.noise_mm**2 * (across @ across.T + beside @ beside.T).toarray())
    return out


def touch_variances(runs: tuple[RunData, ...], placed: Placed) -> FloatArray:
    """Variance (mm²) of every placed edge from the touch noise alone, (m,)."""
    out = []
    for k, data in enumerate(runs):
        across, beside = _touch_rows(data, placed, k)
        out.append(data.noise_mm**2 * np.asarray((across.power(2) + beside.power(2)).sum(axis=1)).ravel())
    return np.concatenate(out)


def _touch_rows(data: RunData, placed: Placed, k: int) -> tuple[csr_matrix, csr_matrix]:
    """How far each event's own error moves each edge of run ``k``, for errors in y and in x."""
    own = placed.run == k
    position, fast = placed.position_fit[k], placed.speed_fit[k]
    velocity = placed.v_mm_s[own]
    shown = np.maximum(np.hypot(velocity[:, 0], velocity[:, 1]), 1e-6)
    # A speed error moves L by L′ and the edge by v_n L′; direction cosines of the motion split it by axis.
    leverage = velocity[:, 1] * placed.slope_s2_mm[own] * placed.stretch[own]
    along_y, along_x = (leverage * velocity[:, axis] / shown for axis in (1, 0))
    n = data.t_s.size
    across = sparse_rows(position.first, position.weights, n)
    across = across + sparse_rows(fast.first, fast.v_weights * along_y[:, None], n)
    return across.tocsr(), sparse_rows(fast.first, fast.v_weights * along_x[:, None], n)


@dataclass(frozen=True)
class Whitener:
    """Cholesky factors of one grid point: ``apply`` makes residuals white; ``log_det`` is ln |C|."""

    components: Components
    factors: tuple[FloatArray, ...]
    slices: tuple[slice, ...]
    log_det: float

    def apply(self, values: FloatArray) -> FloatArray:
        """Whiten (m,) or (m, k)."""
        columns = values.reshape(values.shape[0], -1)
        out = np.empty(columns.shape)
        for factor, own in zip(self.factors, self.slices, strict=True):
            if factor.size:
                out[own] = dtrtrs(factor, columns[own], lower=1)[0]
        return out.reshape(values.shape)


@dataclass(frozen=True)
class Scatter:
    """What the covariance of the used edges is made of, (m, m) for each run, per unit of its component.

    Attributes:
        fixed_mm2: touch noise, how badly the time of a speed is known, and what effects that follow the acceleration
            leave because it is only estimated. speed_mm2: a relative error of the speed. late_mm2_s2: a latency of the
            whole run. uneven_mm2: following the run's changes of speed twice.
        loose_s: (runs,) by how much a run of changing speed may miss the law as a whole: its dynamics are its own.
    """

    fixed_mm2: list[FloatArray]
    speed_mm2: list[FloatArray]
    late_mm2_s2: list[FloatArray]
    uneven_mm2: list[FloatArray]
    loose_s: list[float]


def scatter(runs: tuple[RunData, ...], placed: Placed, use: np.ndarray, blur_mm: FloatArray) -> Scatter:
    """Collect it from a placing. blur_mm: over all placed edges, what is left by effects of the acceleration."""
    across = placed.v_mm_s[:, 1]
    follows = across * placed.stretch * placed.slope_s2_mm
    lever = follows * placed.speed_mm_s
    timing = timing_mm(placed)
    out = Scatter(touch_covariances(runs, placed, use), [], [], [], [])
    for k, data in enumerate(runs):
        own = use & (placed.run == k)
        apart_s = np.abs(placed.t_s[own][:, None] - placed.t_s[own])
        fixed = out.fixed_mm2[k]
        fixed[np.diag_indices_from(fixed)] += timing[own] ** 2 + 1e-6
        if blur_mm[own].any():
            fixed += np.outer(blur_mm[own], blur_mm[own]) * np.exp(-apart_s / ACCEL_MEMORY_S)
        out.speed_mm2.append(np.outer(lever[own], lever[own]) * np.exp(-apart_s / SPEED_MEMORY_S))
        out.late_mm2_s2.append(np.outer(across[own], across[own]))
        speed = placed.speed_mm_s[own]
        uneven = follows[own] * (speed - speed.mean()) if own.any() else speed
        out.uneven_mm2.append(np.outer(uneven, uneven))
        loose = 0.0 if data.steady or not own.any() else UNSTEADY * float(np.std(placed.latency_s[own]))
        out.loose_s.append(loose)
    return out


def timing_mm(placed: Placed) -> FloatArray:
    """What not knowing the time of a speed does to the residual, (m,) mm standard deviation."""
    follows = placed.v_mm_s[:, 1] * placed.stretch * placed.slope_s2_mm
    return np.asarray(follows * placed.accel_mm_s2 * SPEED_TIMING_S)


def whitener(parts: Scatter, components: Components) -> Whitener:
    """Factor C = touch + τ² I + speed error + uneven following + run latency + run offset, block by run.

    Raises numpy.linalg.LinAlgError when a block is not positive definite.
    """
    factors, slices, log_det, at = [], [], 0.0, 0
    for k, fixed in enumerate(parts.fixed_mm2):
        m = fixed.shape[0]
        slices.append(slice(at, at + m))
        at += m
        c = fixed + (components.run_s**2 + parts.loose_s[k] ** 2) * parts.late_mm2_s2[k]
        c += components.run_mm**2 + components.uneven**2 * parts.uneven_mm2[k]
        if components.speed > 0:
            c += components.speed**2 * parts.speed_mm2[k]
        c[np.diag_indices(m)] += components.edge_mm**2
        factor, failed = dpotrf(c.T, lower=1, clean=1, overwrite_a=1) if m else (c, 0)
        if failed:
            raise np.linalg.LinAlgError(f"run {k}: the scatter's covariance is not positive definite")
        log_det += 2 * float(np.sum(np.log(np.diag(factor))))
        factors.append(factor)
    return Whitener(components, tuple(factors), tuple(slices), log_det)
