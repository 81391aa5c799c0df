"""Smoothed position, velocity and acceleration."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from draglag.path.events import sample_interval_s
from draglag.path.savgol import smoothed
from draglag.recording import FloatArray, IntArray, TouchTrace

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

SAVGOL_ORDER = 4  # the paper, Section III.A
SAVGOL_WINDOW = 61
IN_CACHE = 16384  # numbers that are worked on at once
SPEED_TIMING_S = 0.01  # a speed read from a window of 50–250 ms is not known to better than this in time
FEW_MATRICES = 250  # of which each is inverted by itself in less time
DEGREE = 3  # cubic: unbiased for constant jerk, and odd orders cost nothing at the centre of a window


def savitzky_golay(touch: TouchTrace) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """t_s, x_mm, y_mm, speed_mm_s by the paper's smoother on an even grid: above 700 mm/s, speed is 5–33 % low.

    Raises ValueError with fewer than 61 samples.
    """
    dt_s = sample_interval_s(touch.t_s)
    grid_s = np.arange(touch.t_s[0], touch.t_s[-1], dt_s)
    if grid_s.size < SAVGOL_WINDOW:
        raise ValueError(f"{grid_s.size} samples, the filter needs {SAVGOL_WINDOW}")
    xy = [np.interp(grid_s, touch.t_s, v) for v in (touch.x_mm, touch.y_mm)]
    x_mm, y_mm = (smoothed(v, SAVGOL_WINDOW, SAVGOL_ORDER) for v in xy)
    vx, vy = (smoothed(v, SAVGOL_WINDOW, SAVGOL_ORDER, 1, dt_s) for v in xy)
    return grid_s, x_mm, y_mm, np.hypot(vx, vy)


@dataclass(frozen=True, eq=False)
class FitWeights:
    """Contribution of each event of a window to local fits at m times, (m, w) each."""

    solution: FloatArray
    weighted: FloatArray
    width_s: FloatArray

    @cached_property
    def position(self) -> FloatArray:
        return self._of_power(0)

    @cached_property
    def velocity(self) -> FloatArray:
        return self._of_power(1) / self.width_s[:, None]

    @cached_property
    def acceleration(self) -> FloatArray:
        if self.solution.shape[1] < 3:
            return np.zeros_like(self.position)
        return 2 * self._of_power(2) / self.width_s[:, None] ** 2

    def _of_power(self, power: int) -> FloatArray:
        return np.asarray(np.einsum("mp,pmw->mw", self.solution[:, power], self.weighted))


@dataclass(frozen=True)
class LocalFit:
    """Local polynomial fits at m times.

    ``first``: index of the first event in each window; ``ok``: enough events, on both sides.
    """

    at_s: FloatArray
    xy_mm: FloatArray
    v_mm_s: FloatArray
    a_mm_s2: FloatArray
    first: IntArray
    by_event: FitWeights
    ok: np.ndarray

    @property
    def speed_mm_s(self) -> FloatArray:
        return np.hypot(self.v_mm_s[:, 0], self.v_mm_s[:, 1])

    def rows(self, weights: FloatArray, n: int) -> csr_matrix:
        """Weights (m, n) of n events in each fit, from one kind of ``by_event``."""
        from scipy.sparse import csr_matrix

        at = np.minimum(self.first[:, None] + np.arange(weights.shape[1]), n - 1)
        ends = np.arange(0, at.size + 1, at.shape[1])
        out = csr_matrix((weights.ravel(), at.ravel(), ends), shape=(at.shape[0], n))
        out.sum_duplicates()
        return out

    @property
    def gain(self) -> FloatArray:
        """Variance of a fitted position over that of one event, (m,)."""
        return np.asarray(np.einsum("mw,mw->m", self.by_event.position, self.by_event.position))

    @property
    def v_gain(self) -> FloatArray:
        """The same of a velocity component, per s²."""
        return np.asarray(np.einsum("mw,mw->m", self.by_event.velocity, self.by_event.velocity))


def local_fit(
    t_s: FloatArray,
    xy_mm: FloatArray,
    at_s: FloatArray,
    half_width_s: float | FloatArray,
    degree: int = DEGREE,
    roundness: int = 1,
) -> LocalFit:
    """Polynomial fits within ``half_width_s`` (scalar or (m,)) of each time.

    ``roundness``: power of the weights 1 − u²; 1 (Epanechnikov) is best for white noise, 3 has low side lobes.
    """
    m = at_s.size
    width_s = np.full(m, half_width_s, float)
    first = t_s.searchsorted(at_s - width_s, side="right")
    last = t_s.searchsorted(at_s + width_s, side="left")
    middle, count = t_s.searchsorted(at_s), last - first
    w = max(int(np.max(count, initial=1)), degree + 1)
    weighted, both = np.empty((degree + 1, m, w)), np.empty((m, degree + 1, degree + 3))
    rows, place, (x_mm, y_mm) = max(IN_CACHE // w, 1), np.arange(w), np.ascontiguousarray(xy_mm.T)
    for part in (slice(begin, begin + rows) for begin in range(0, m, rows)):
        index = np.minimum(first[part, None] + place, t_s.size - 1)
        u = (t_s.take(index) - at_s[part, None]) / width_s[part, None]
        kernel = np.maximum(1 - u * u, 0.0)
        kernel *= place < count[part, None]
        # Powers and both coordinates side by side: one product of matrices gives the normal ones and the moments.
        sides, own = np.empty((degree + 3, *u.shape)), weighted[:, part]
        sides[0], own[0] = 1.0, kernel
        for _ in range(roundness - 1):
            own[0] *= kernel
        for order in range(degree):
            np.multiply(sides[order], u, out=sides[order + 1])
            np.multiply(own[order], u, out=own[order + 1])
        sides[-2], sides[-1] = x_mm.take(index), y_mm.take(index)
        both[part] = own.transpose(1, 0, 2) @ sides.transpose(1, 2, 0)
    # Inside a window of half width h the events must reach to both sides, or the fit extrapolates.
    ok = (count >= degree + 2) & (middle >= first + 2) & (middle <= last - 2)
    normal = both[:, :, :-2]
    if not ok.all():
        normal[~ok] = np.eye(degree + 1)
    diagonal = np.einsum("mpp->mp", normal)
    diagonal += 1e-12 * diagonal.sum(1, keepdims=True)
    solution = inverse(normal)
    coefficients = solution @ both[:, :, -2:]  # (m, p, 2)
    return LocalFit(
        at_s,
        coefficients[:, 0],
        coefficients[:, 1] / width_s[:, None],
        2 * coefficients[:, 2] / width_s[:, None] ** 2 if degree > 1 else np.zeros((m, 2)),
        first.astype(np.int64),
        FitWeights(solution, weighted, width_s),
        ok,
    )


def inverse(matrices: FloatArray) -> FloatArray:
    """Inverses of symmetric positive definite matrices (m, p, p)."""
    m, p, _ = matrices.shape
    if m < FEW_MATRICES:
        return np.asarray(np.linalg.inv(matrices), float)
    a = {(i, j): matrices[:, i, j].copy() for i in range(p) for j in range(i, p)}
    for k in range(p):
        others = [i for i in range(p) if i != k]
        column = {i: a[min(i, k), max(i, k)] for i in others}
        scaled = {i: column[i] / a[k, k] for i in others}
        for i, j in ((i, j) for i in others for j in others if i <= j):
            a[i, j] -= column[i] * scaled[j]
        for i in others:
            a[min(i, k), max(i, k)] = scaled[i]
        a[k, k] = -1 / a[k, k]
    out = np.empty((m, p, p))
    for (i, j), values in a.items():
        out[:, i, j] = out[:, j, i] = -values
    return out


def best_half_width_s(t_s: FloatArray, values_mm: FloatArray, near_s: FloatArray) -> tuple[float, float]:
    """Bandwidth (s) of the best leave-one-out prediction of events near ``near_s``, and the noise it leaves (mm).

    NaN for too short a trace.
    """
    dt_s = sample_interval_s(t_s)
    slot, even = _even_grid(t_s, values_mm, dt_s)
    near = _near(t_s, near_s, max(6 * dt_s, 0.08))
    best = (3.5 * dt_s, np.inf, float("nan"))
    rising = 0
    for samples in 3.5 * 1.3 ** np.arange(13):
        weights = _even_weights(samples)
        reach = weights.size // 2
        if slot[-1] < 4 * weights.size:
            break
        own = weights[reach]
        fitted = np.column_stack([np.convolve(column, weights, mode="same") for column in even.T])[slot]
        keep = near & np.isfinite(fitted).all(1) & (slot >= reach) & (slot <= slot[-1] - reach)
        if np.count_nonzero(keep) < 20:
            break
        residual = even[slot[keep]] - fitted[keep]
        squared = np.sum((residual / (1 - own)) ** 2, axis=1)
        risk = float(np.mean(np.minimum(squared, 25 * np.median(squared))))
        if risk < best[1]:
            # E r² of a fitted event is σ² (1 − 2·own + Σ w²), and Σ w² = own for these weights to a few percent.
            noise = np.sqrt(risk * (1 - own) ** 2 / (values_mm.shape[1] * (1 - 2 * own + float(weights @ weights))))
            best, rising = (samples * dt_s, risk, float(noise)), 0
        else:
            rising += 1
            if rising == 3:
                break
    return best[0], best[2]


def _even_grid(t_s: FloatArray, values: FloatArray, dt_s: float) -> tuple[IntArray, FloatArray]:
    steps = np.maximum(np.round(np.diff(t_s) / dt_s), 1).astype(np.int64)
    slot = np.concatenate([[0], np.cumsum(steps)])
    velocity = np.gradient(values, t_s, axis=0)
    # The grid follows the stream's own slow rate: a running mean of stamp minus slot.
    late_s = t_s - dt_s * slot
    smooth = np.convolve(np.pad(late_s, 20, mode="edge"), np.full(41, 1 / 41), mode="valid")
    even = np.full((int(slot[-1]) + 1, values.shape[1]), np.nan)
    even[slot] = values - velocity * (late_s - smooth)[:, None]
    return slot, even


def _even_weights(samples: float) -> FloatArray:
    reach = int(np.ceil(samples)) - 1
    u = np.arange(-reach, reach + 1) / samples
    powers = u[:, None] ** np.arange(DEGREE + 1)
    weighted = (1 - u * u)[:, None] * powers
    return np.asarray(np.linalg.solve(weighted.T @ powers, weighted.T)[0])


def _near(t_s: FloatArray, at_s: FloatArray, reach_s: float) -> np.ndarray:
    at_s = np.sort(at_s)
    k = np.searchsorted(at_s, t_s)
    left = t_s - at_s[np.clip(k - 1, 0, at_s.size - 1)]
    right = at_s[np.clip(k, 0, at_s.size - 1)] - t_s
    return np.minimum(np.abs(left), np.abs(right)) <= reach_s


def speed_half_widths_s(t_s: FloatArray, xy_mm: FloatArray, at_s: FloatArray, noise_mm: float) -> FloatArray:
    """Half widths (m,) for speeds at which to evaluate a latency law.

    The widest window whose velocity agrees with all narrower ones within noise (Lepski's rule).
    """
    narrowest = max(0.04, 4.5 * sample_interval_s(t_s))
    widths = [w for w in (0.25, 0.18, 0.13, 0.095, 0.07, 0.05) if w > narrowest] + [narrowest]
    fits = [local_fit(t_s, xy_mm, at_s, w) for w in widths]
    out = np.full(at_s.shape, narrowest)
    undecided = np.ones(at_s.shape, bool)
    for k, wide in enumerate(fits[:-1]):
        agrees = wide.ok.copy()
        for narrow in fits[k + 1 :]:
            difference = np.sum((wide.v_mm_s - narrow.v_mm_s) ** 2, axis=1)
            expected = 2 * noise_mm**2 * np.maximum(narrow.v_gain - wide.v_gain, 0.1 * narrow.v_gain)
            agrees &= ~narrow.ok | (difference <= 6.0 * expected)  # one in 400 by chance
        chosen = undecided & agrees
        out[chosen] = widths[k]
        undecided &= ~chosen
    return out
