"""Tremor (8 to 12 Hz), by Wiener's filter on residuals of the path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft, rfft

from draglag.latency.path import INDEPENDENT_S, Path, looked_up, tapered
from draglag.latency.spectrum import Events
from draglag.numerics import fast_length
from draglag.recording import FloatArray

BAND_HZ = (7.0, 14.0)
FLANKS_HZ = ((4.5, 7.0), (14.0, 20.0))
SMOOTH_HZ = 1.2
COHERENCE_S = 0.5  # tremor this old does not predict its phase
NOISE_CORNER_HZ = 4.0  # of noise that a digitiser's filter leaves; what counts is that it falls as 1/f² in the band
FINEST_S = 1 / 110  # straight lines between points this far apart are true to 4 % at 10 Hz


@dataclass(frozen=True)
class Tremor:
    """Tremor on a fine grid, (g, 2), and autocovariances by lag in its steps, mm², (k,).

    ``unobserved``: of the estimate's error; ``whole``: of the tremor; ``speed2``: variance of one velocity component,
    (mm/s)². The last two are across the motion: a speed-dependent latency magnifies tremor along it.
    """

    start_s: float
    step_s: float
    xy_mm: FloatArray
    unobserved: FloatArray
    whole: FloatArray
    speed2: float

    def at(self, t_s: FloatArray) -> FloatArray:
        """Tremor (m, 2) at times (m,)."""
        position = np.clip((t_s - self.start_s) / self.step_s, 0.0, self.xy_mm.shape[0] - 1.001)
        k = position.astype(np.int64)
        f = (position - k)[:, None]
        return np.asarray((1 - f) * self.xy_mm[k] + f * self.xy_mm[k + 1])

    def by_lag(self, lag_s: FloatArray, estimated: bool) -> FloatArray:
        """Autocovariance of one coordinate's error, mm², with or without the estimate."""
        return looked_up(self.unobserved if estimated else self.whole, lag_s / self.step_s)

    def mean_speed2(self, t_s: FloatArray, ahead: FloatArray) -> float:
        """Variance of the mean tremor velocity along ``ahead`` (m, 2) over edges, (mm/s)²."""
        m = t_s.size
        reach = int(np.max(np.searchsorted(t_s, t_s + COHERENCE_S) - np.arange(m)))
        later = np.arange(1, reach)[:, None] + np.arange(m)
        inside = later < m
        later = np.minimum(later, m - 1)
        alike = looked_up(self.whole, (t_s[later] - t_s) / self.step_s) * inside
        same_way = ahead[later, 0] * ahead[:, 0] + ahead[later, 1] * ahead[:, 1]
        shared = m + 2 * float(np.vdot(alike, same_way)) / max(float(self.whole[0]), 1e-12)
        return self.speed2 * max(shared, 0.0) / m**2


def tremor_of(events: Events, path: Path, v_mm_s: FloatArray, under: Path | None = None) -> Tremor | None:
    """The tremor of a run; None if touch rate or duration do not show any.

    ``v_mm_s``: (n, 2) the path's velocity; ``under``: another path it is added to, which may keep some tremor.
    """
    n = int(events.slot[-1]) + 1
    size = fast_length(n + round(1.0 / events.dt_s))
    f_hz = np.arange(size // 2 + 1) / (size * events.dt_s)
    if f_hz[-1] < FLANKS_HZ[1][1] + 2 or n * events.dt_s < 2.0:
        return None
    left = events.xy_mm - path.at(events.t_s)
    speed = np.maximum(np.hypot(v_mm_s[:, 0], v_mm_s[:, 1]), 1e-6)
    even = np.zeros((3, size))  # what is left of x, of y, and of both across the motion
    even[:2, events.slot] = left.T
    even[2, events.slot] = (left[:, 0] * v_mm_s[:, 1] - left[:, 1] * v_mm_s[:, 0]) / speed
    f_hz = f_hz[: np.searchsorted(f_hz, FLANKS_HZ[1][1] + 2)]
    transform = rfft(even)[:, : f_hz.size]
    squared = (transform.real**2 + transform.imag**2) * (2 * events.dt_s / events.slot.size)
    power = squared[:2].mean(0)
    width = max(1, round(SMOOTH_HZ / f_hz[1]))
    inside = (f_hz >= BAND_HZ[0]) & (f_hz <= BAND_HZ[1])
    floor, excess = _over_the_floor(f_hz, power, inside, width)
    gain = excess / np.maximum(excess + floor, 1e-12)
    floor_across, excess_across = _over_the_floor(f_hz, squared[2], inside, width)
    own = (squared[2] - floor_across)[inside]
    speed2 = max(float(((2 * np.pi * f_hz[inside]) ** 2 * own).sum()) * float(f_hz[1]), 0.0)
    finer = int(np.ceil(events.dt_s / FINEST_S))
    # Noise that a path with a high corner keeps is counted with that path.
    rest = 1.0 if under is None else 1 - under.keeps(f_hz)
    fine = irfft(transform[:2] * (gain * rest), size * finer).T * finer
    step_s = events.dt_s / finer
    points = 2 ** int(np.ceil(np.log2(2 * INDEPENDENT_S / step_s)))
    lag_hz = np.arange(points // 2 + 1) / (points * step_s)
    to_lag = 0.5 * lag_hz[1] * points
    unobserved, whole = (
        tapered(irfft(to_lag * np.interp(lag_hz, f_hz, one, right=0.0), points)[: points // 2], step_s)
        for one in (gain * floor * rest, excess_across * rest)
    )
    return Tremor(float(events.t_s[0]), step_s, fine[: n * finer], unobserved, whole, speed2)


def _over_the_floor(
    f_hz: FloatArray, power: FloatArray, inside: np.ndarray, width: int
) -> tuple[FloatArray, FloatArray]:
    total = np.cumsum(np.pad(power, (width // 2 + 1, width - width // 2), mode="edge"))
    smooth = (total[width:] - total[:-width])[: power.size] / width
    # A white part, and one that falls with frequency as a digitiser's own filter leaves it: straight lines between
    # both sides would lie above it and take a fifth of the tremor for noise.
    falling = 1 / (1 + (f_hz / NOISE_CORNER_HZ) ** 2)
    (p_low, g_low), (p_high, g_high) = (
        (float(power[flank].mean()), float(falling[flank].mean()))
        for flank in ((f_hz >= low) & (f_hz < high) for low, high in FLANKS_HZ)
    )
    floor = p_high + (p_low - p_high) * np.maximum(falling - g_high, 0.0) / (g_low - g_high)
    return floor, np.where(inside, np.maximum(smooth - floor, 0.0), 0.0)
