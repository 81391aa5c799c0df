"""The paper's smoother of traces, and the windows of local fits that noise allows."""

from __future__ import annotations

import numpy as np

from draglag.path.events import sample_interval_s
from draglag.path.local_fit import DEGREE, local_fit
from draglag.path.savgol import smoothed
from draglag.recording import FloatArray, IntArray, TouchTrace

SAVGOL_ORDER = 4  # the paper, Section III.A
SAVGOL_WINDOW = 61
NARROWEST = 3.5  # events: half of the narrowest window
FEWEST = 20  # predicted events from which a noise is known
SPEED_TIMING_S = 0.01  # a speed read from a window of 50–250 ms is not known to better than this in time


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


def best_half_width_s(t_s: FloatArray, values_mm: FloatArray, near_s: FloatArray) -> tuple[float, float]:
    """Bandwidth (s) of the best leave-one-out prediction of events near ``near_s``, and the noise it leaves (mm).

    NaN for too short a trace.
    """
    dt_s = sample_interval_s(t_s)
    slot, even = _even_grid(t_s, values_mm, dt_s)
    size = _even_weights(NARROWEST).size
    if slot[-1] >= size and _n_whole(even, size) < FEWEST:
        even = _bridged(even)
    near = _near(t_s, near_s, max(6 * dt_s, 0.08))
    best = (NARROWEST * dt_s, np.inf, float("nan"))
    rising = 0
    for samples in NARROWEST * 1.3 ** np.arange(13):
        weights = _even_weights(samples)
        reach = weights.size // 2
        if slot[-1] < 4 * weights.size:
            break
        own = weights[reach]
        fitted = np.column_stack([np.convolve(column, weights, mode="same") for column in even.T])[slot]
        keep = near & np.isfinite(fitted).all(1) & (slot >= reach) & (slot <= slot[-1] - reach)
        if np.count_nonzero(keep) < FEWEST:
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


def _n_whole(even: FloatArray, size: int) -> int:
    """Windows of an even grid (k, c) without a missing event."""
    missing = np.isnan(even[:, 0])
    return int(np.count_nonzero(np.convolve(missing, np.ones(size), mode="valid") < 0.5))


def _bridged(even: FloatArray) -> FloatArray:
    """Grid with cubics over single missing events: where a loop asks faster than the panel reports, every few are."""
    out = even.copy()
    a, b, hole, c, d = (even[k : len(even) - 4 + k] for k in range(5))
    out[2:-2] = np.where(np.isnan(hole), (9 * (b + c) - a - d) / 16, hole)
    return out


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
