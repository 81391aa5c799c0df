"""The spectrum of touch events, and the corner where the path falls into noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.fft import rfft

from draglag.path.events import median, sample_interval_s
from draglag.recording import FloatArray, IntArray

SEGMENT_S = 8.0
LONGEST_FILL = 3  # missing events that interpolation bridges without harm
NOISE_UP_TO_HZ = 7.0  # between the path and tremor there is only noise
QUIET_FROM_HZ = 14.0  # and above tremor
CIRCLES_UP_TO_HZ, STROKES_UP_TO_HZ = 12.0, 30.0  # corners that are tried: a stroke turns within 0.1 s. Physical
FILTERS_HZ = (2.0, 4.0, 8.0, 16.0)
TOGETHER = 0.25  # of the interval: closer events were delivered together


@dataclass(frozen=True)
class Spectrum:
    """One-sided power, mm²/Hz; ``median``: median over mean of noise."""

    f_hz: FloatArray
    power: FloatArray
    dt_s: float
    median: float


@dataclass(frozen=True)
class Events:
    """Touch events (n,) on slots of an even grid."""

    slot: IntArray
    t_s: FloatArray
    xy_mm: FloatArray
    dt_s: float

    def even(self, values: FloatArray) -> FloatArray:
        """Values (n, k) on every slot, missing ones interpolated."""
        every = np.arange(int(self.slot[-1]) + 1)
        if every.size == self.slot.size:
            return values
        return np.column_stack([np.interp(every, self.slot, column) for column in values.T])


def events_of(t_s: FloatArray, xy_mm: FloatArray, dt_s: float | None = None) -> Events:
    """Rising events (n,), numbered on an even grid.

    Of events delivered together, as after a stall, the last is in time; others get the slots before it.
    """
    dt_s = sample_interval_s(t_s) if dt_s is None else dt_s
    last = np.append(np.diff(t_s) > TOGETHER * dt_s, True)
    ends = np.flatnonzero(last)
    size = np.diff(np.append(-1, ends))
    steps = np.maximum(np.round(np.diff(t_s[ends]) / dt_s).astype(np.int64), size[1:])
    end_slot = size[0] - 1 + np.concatenate([[0], np.cumsum(steps)])
    group = np.searchsorted(ends, np.arange(t_s.size))
    slot = end_slot[group] - (ends[group] - np.arange(t_s.size))
    return Events(slot, t_s, xy_mm, float((t_s[-1] - t_s[0]) / slot[-1]))


def spectrum_of(events: Events) -> Spectrum:
    """Welch's spectrum, side lobes at −92 dB: the path is 80 dB above the noise."""
    late_s = events.t_s - events.t_s[0] - events.dt_s * events.slot
    # Stamps jitter: each event is slid along its velocity onto the grid.
    velocity = np.gradient(events.xy_mm, events.slot, axis=0) / events.dt_s
    even = events.even(events.xy_mm - velocity * (late_s - _slow(late_s))[:, None])
    n = even.shape[0]
    m = min(round(SEGMENT_S / events.dt_s), n)
    window, ramp = _window(m)
    starts = np.arange(0, n - m + 1, max(m // (4 if n < 3 * m else 2), 1))
    # A filled gap resembles noise of every frequency: only stretches without one count, where there are any.
    gap = events.slot[:-1][np.diff(events.slot) > LONGEST_FILL]
    holes = np.searchsorted(gap, starts + m) - np.searchsorted(gap, starts)
    starts = starts[holes == holes.min()]
    pieces = np.lib.stride_tricks.sliding_window_view(np.ascontiguousarray(even.T), m, axis=1)[:, starts]
    pieces = pieces - pieces[..., :1] - ramp * (pieces[..., -1:] - pieces[..., :1])
    pieces -= pieces.mean(-1, keepdims=True)
    transform = rfft(window * pieces)
    power = np.mean(transform.real**2 + transform.imag**2, axis=(0, 1)) * 2 * events.dt_s / float(window @ window)
    f_hz = np.asarray(np.fft.rfftfreq(m, events.dt_s))
    median = (1 - 1 / (18 * starts.size)) ** 3  # of χ² with four degrees of freedom a window (Wilson–Hilferty)
    return Spectrum(f_hz, np.asarray(power, np.float64), events.dt_s, float(median))


@lru_cache(maxsize=16)
def _window(m: int) -> tuple[FloatArray, FloatArray]:
    """Blackman–Harris window (Harris 1978, four terms) and a ramp, (m,) each."""
    turn = np.linspace(-np.pi, np.pi, m + 1)[:-1]
    window = sum(a * np.cos(k * turn) for k, a in enumerate((0.35875, 0.48829, 0.14128, 0.01168)))
    return np.asarray(window), np.linspace(0, 1, m)


def _slow(late_s: FloatArray) -> FloatArray:
    if late_s.size < 42:
        return np.full(late_s.shape, float(late_s.mean()))
    total = np.cumsum(np.pad(late_s, (21, 20), mode="edge"))
    return np.asarray((total[41:] - total[:-41]) / 41)


def corner_of(spectrum: Spectrum) -> tuple[float, float, float]:
    """The run's rhythm (0 if none), its path's corner, and the noise there, mm²/Hz one-sided.

    The corner minimises Mallows' estimate of path removed plus noise kept.
    """
    f, power = spectrum.f_hz, spectrum.power
    rhythm = _rhythm_hz(spectrum)
    top = max(NOISE_UP_TO_HZ, 2.5 * rhythm)
    between = (f > rhythm + 2 * f[1]) & (f < top)
    noise = median(power[between]) / spectrum.median if between.any() else float(power.min())
    corners, loss = _corners(spectrum, rhythm)
    used = f < top
    loss = loss[:, used]
    for _ in range(2):
        risk = (loss**2 * power[used]).sum(1) + 2 * noise * (1 - loss).sum(1)
        corner = float(corners[int(np.argmin(risk))])
        beyond = (f > corner) & (f < max(top, 1.5 * corner))
        if np.count_nonzero(beyond) >= 5:
            noise = median(power[beyond]) / spectrum.median
    return rhythm, corner, _noise_below(spectrum, corner, noise)


def corner_of_strokes(spectrum: Spectrum) -> tuple[float, float, float]:
    """As ``corner_of``, for strokes: their turns have every harmonic of the rhythm, so that none is free."""
    f, power = spectrum.f_hz, spectrum.power
    up_to_hz = min(STROKES_UP_TO_HZ, 0.5 * float(f[-1]))
    noise = median(power[f > min(QUIET_FROM_HZ, up_to_hz)]) / spectrum.median
    corners, loss = _corners(spectrum, 0.0, up_to_hz)
    for _ in range(2):
        risk = (loss**2 * power).sum(1) + 2 * noise * (1 - loss).sum(1)
        corner = float(corners[int(np.argmin(risk))])
        beyond = f > 1.5 * corner
        if np.count_nonzero(beyond) >= 5:
            noise = median(power[beyond]) / spectrum.median
    return 0.0, corner, noise


def corner_for_mean(spectrum: Spectrum, rhythm_hz: float, corner_hz: float, noise: float, places: float) -> float:
    """The best corner for a mean over independent places, in which noise averages out."""
    corners, loss = _corners(spectrum, rhythm_hz)
    used = spectrum.f_hz < max(NOISE_UP_TO_HZ, 2.5 * rhythm_hz)
    loss, own = loss[:, used], spectrum.power[used] - noise
    risk = (loss**2 * own).sum(1) + noise / places * ((1 - loss) ** 2).sum(1)
    return max(corner_hz, float(corners[int(np.argmin(risk))]))


def _rhythm_hz(spectrum: Spectrum) -> float:
    f, power = spectrum.f_hz, spectrum.power
    peak = int(np.argmax(power))
    if not 1 < peak < f.size - 2:
        return 0.0
    a, b, c = np.log(power[peak - 1 : peak + 2])
    rhythm = float(f[peak] + f[1] * 0.5 * (a - c) / (a - 2 * b + c))
    return 0.0 if rhythm < 3 * f[1] else rhythm


def _corners(spectrum: Spectrum, rhythm_hz: float, up_to_hz: float = CIRCLES_UP_TO_HZ) -> tuple[FloatArray, FloatArray]:
    f = spectrum.f_hz
    start = max(1.15 * rhythm_hz, rhythm_hz + 2 * f[1], 3 * f[1])
    corners = start * (max(up_to_hz, 3 * rhythm_hz) / start) ** np.linspace(0, 1, 30)
    at = penalty_at_corner(corners, rhythm_hz)
    return corners, 1 / (1 + at[:, None] / np.maximum(penalty(f, rhythm_hz)[None], 1e-30))


def _noise_below(spectrum: Spectrum, corner_hz: float, noise: float) -> float:
    """White and low-pass noise below the corner, extrapolated from both sides of tremor."""
    f, power = spectrum.f_hz, spectrum.power
    seen = ((f > 1.1 * corner_hz) & (f < NOISE_UP_TO_HZ)) | (f > QUIET_FROM_HZ)
    if np.count_nonzero(seen & (f < NOISE_UP_TO_HZ)) < 6 or not (f > QUIET_FROM_HZ).any():
        return noise
    f, power = f[seen], power[seen]
    white = float(power[f > QUIET_FROM_HZ].mean())
    level = np.where(f < NOISE_UP_TO_HZ, max(noise, white), white)
    # The mean of a spectrum is known to a fixed share of itself: weighted least squares, every filter at once.
    filters_hz = np.array(FILTERS_HZ)[:, None]
    slow = 1 / (1 + (f / filters_hz) ** 2)
    share, y = slow / level, power / level
    aa, ab, bb = float(np.sum(level**-2.0)), share @ (1 / level), (share**2).sum(1)
    ay, by = float(np.sum(y / level)), share @ y
    rise = np.maximum((aa * by - ab * ay) / (aa * bb - ab**2), 0.0)
    flat = (ay - rise * ab) / aa
    model = flat[:, None] + rise[:, None] * slow
    good = (model > 0).all(1)
    if not good.any():
        return noise
    costs = np.where(good, (power / np.where(good[:, None], model, 1.0)).sum(1), np.inf)
    costs[good] += np.log(model[good]).sum(1)
    inside_hz = np.linspace(0, corner_hz, 20)
    below = flat + rise * (1 / (1 + (inside_hz / filters_hz) ** 2)).mean(1)
    likely = np.exp(np.min(costs) - costs)
    return float(likely @ below / likely.sum())


def penalty(f_hz: FloatArray, rhythm_hz: float) -> FloatArray:
    """Penalty by frequency: zero at 0, the rhythm and its third harmonic."""
    third = f_hz**2 - 9 * rhythm_hz**2 if rhythm_hz > 0 else 1.0
    return np.asarray((f_hz**2 * (f_hz**2 - rhythm_hz**2) ** 2 * third) ** 2)


def penalty_at_corner(corner_hz: FloatArray, rhythm_hz: float) -> FloatArray:
    """The penalty, kept rising past the third harmonic."""
    third = np.maximum(9 * rhythm_hz**2 - corner_hz**2, corner_hz**2 / 3) if rhythm_hz > 0 else 1.0
    return np.asarray((corner_hz**2 * (corner_hz**2 - rhythm_hz**2) ** 2 * third) ** 2)
