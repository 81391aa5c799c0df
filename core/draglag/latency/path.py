"""Where the stylus went, from a run's touch events: a smoother matched to the run's own spectrum.

A hand that follows a circle moves at the circle's frequency, a little around it, and slowly about its centre; a few
hertz above that the spectrum falls into the events' noise within an octave. Local polynomials cut too softly for so
steep an edge. So the path is a penalised B-spline whose penalty leaves straight lines and the run's own rhythm
alone, with its corner where the spectrum meets the noise: D²(D² + ω²)²(D² + 9ω²) p. The third harmonic is what a
latency that depends on speed makes of an oval. The equations are banded: gaps, ends and
uneven stamps are treated exactly, and the covariance of any set of its points follows from the same factor.

What is left of the events is noise and whatever the hand did faster than the corner (tremor, 8 to 12 Hz).
``Fast`` estimates the latter with Wiener's filter.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csc_array

from draglag.events import median, sample_interval_s
from draglag.recording import FloatArray, IntArray

SEGMENT_S = 8.0
KNOTS_PER_PERIOD = 10.0  # of the corner frequency
LONGEST_FILL = 3  # missing events that interpolation bridges without harm
NOISE_UP_TO_HZ = 7.0  # between the path and tremor there is only noise
INDEPENDENT_S = 3.0  # edges further apart share no error
LAG_STEP_S, LAG_POINTS = 0.005, 2048  # of the table of covariances
QUIET_FROM_HZ = 14.0  # and above tremor
FILTERS_HZ = (2.0, 4.0, 8.0, 16.0)


@dataclass(frozen=True)
class Spectrum:
    """One-sided power of one coordinate, mean of both: f_hz (k,), power (k,) mm²/Hz, and its median over its mean.

    dt_s: the mean event interval.
    """

    f_hz: FloatArray
    power: FloatArray
    dt_s: float
    median: float


TOGETHER = 0.25  # of the interval: closer events were delivered together


@dataclass(frozen=True)
class Events:
    """Touch events on slots of an even grid: slot (n,), t_s (n,), xy_mm (n, 2), dt_s."""

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
    """Events at increasing times t_s (n,), xy_mm (n, 2), numbered by the slots of an even grid (of dt_s, if known).

    Of events that come together, as after a stall of the host, the last is in time and the others belong to the slots
    before it.
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
    """Welch's spectrum with windows whose side lobes are 92 dB down: the path is 80 dB above the noise."""
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
    """Blackman–Harris, periodic (Harris 1978, four terms, −92 dB), and a ramp: (m,) each."""
    turn = np.linspace(-np.pi, np.pi, m + 1)[:-1]
    window = sum(a * np.cos(k * turn) for k, a in enumerate((0.35875, 0.48829, 0.14128, 0.01168)))
    return np.asarray(window), np.linspace(0, 1, m)


def _slow(late_s: FloatArray) -> FloatArray:
    """The stream's own slow rate: a running mean over 41 events."""
    if late_s.size < 42:
        return np.full(late_s.shape, float(late_s.mean()))
    total = np.cumsum(np.pad(late_s, (21, 20), mode="edge"))
    return np.asarray((total[41:] - total[:-41]) / 41)


def corner_of(spectrum: Spectrum) -> tuple[float, float, float]:
    """The run's rhythm f₀ (0 where it has none), the corner of its path, Hz, and the noise there, mm²/Hz one-sided.

    The corner makes Mallows' estimate of the error least: what the filter takes from the path and leaves of the noise.
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


def corner_for_mean(spectrum: Spectrum, rhythm_hz: float, corner_hz: float, noise: float, places: float) -> float:
    """The corner, Hz, that a mean over so many independent places is best known by: not below that of single places.

    What the filter takes from the path is harmonics of the rhythm, the same at every pass; noise is another at each.
    """
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


def _corners(spectrum: Spectrum, rhythm_hz: float) -> tuple[FloatArray, FloatArray]:
    """The corners to choose from, Hz, (c,), and what each takes off at the spectrum's frequencies, (c, k)."""
    f = spectrum.f_hz
    start = max(1.15 * rhythm_hz, rhythm_hz + 2 * f[1], 3 * f[1])
    corners = start * (max(12.0, 3 * rhythm_hz) / start) ** np.linspace(0, 1, 30)
    at = _penalty_at_corner(corners, rhythm_hz)
    return corners, 1 / (1 + at[:, None] / np.maximum(_penalty(f, rhythm_hz)[None], 1e-30))


def _noise_below(spectrum: Spectrum, corner_hz: float, noise: float) -> float:
    """Mean power of the noise below the corner, mm²/Hz, where the path hides it.

    A digitiser's own filter leaves noise that rises towards low frequencies; what is seen beyond the corner, on both
    sides of tremor, is continued by a white and a first-order low-pass part.
    """
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


@dataclass(frozen=True)
class Path:
    """The smoothed path on even knots.

    Attributes:
        start_s, step_s: the knots. coefficients: (k, 2). factor: banded Cholesky factor of the normal equations.
        noise_mm: standard deviation of an event, had it all over its band the noise it has below the corner.
        noise_dof: degrees of freedom that this is known with.
        dt_s: mean interval of the events. gather: (k, n) the splines at the events.
    """

    start_s: float
    step_s: float
    coefficients: FloatArray
    factor: FloatArray
    noise_mm: float
    rhythm_hz: float
    corner_hz: float
    noise_dof: float
    dt_s: float
    gather: csc_array = field(repr=False)

    def at(self, t_s: FloatArray, order: int = 0) -> FloatArray:
        """Position (0), velocity (1) or acceleration (2) at times of any shape, (..., 2)."""
        position = (t_s - self.start_s) / self.step_s
        first = np.clip(position.astype(np.int64), 0, self.coefficients.shape[0] - 4)
        u = position - first
        a, b, c, d = self._powers
        if order == 0:
            out = ((d.take(first) * u + c.take(first)) * u + b.take(first)) * u + a.take(first)
        elif order == 1:
            out = ((3 * d.take(first) * u + 2 * c.take(first)) * u + b.take(first)) / self.step_s
        else:
            out = (6 * d.take(first) * u + 2 * c.take(first)) / self.step_s**2
        return np.asarray(out.view(np.float64).reshape(*t_s.shape, 2))

    def with_velocity(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position and velocity at times of any shape, (..., 2) each: ``at`` for both at once."""
        position = (t_s - self.start_s) / self.step_s
        first = np.clip(position.astype(np.int64), 0, self.coefficients.shape[0] - 4)
        u = position - first
        a, b, c, d = (power.take(first) for power in self._powers)
        du = d * u
        cdu = c + du
        place = (cdu * u + b) * u + a
        velocity = ((cdu + cdu + du) * u + b) / self.step_s
        shape = (*t_s.shape, 2)
        return place.view(np.float64).reshape(shape), velocity.view(np.float64).reshape(shape)

    @cached_property
    def _powers(self) -> tuple[NDArray[np.complex128], ...]:
        """Coefficients x + iy of the cubic of each interval, (k − 3,) for each power of the share of it."""
        whole = np.asarray(self.coefficients[:, 0] + 1j * self.coefficients[:, 1], np.complex128)
        a, b, c, d = (whole[j : whole.size - 3 + j] / 6 for j in range(4))
        return a + 4 * b + c, 3 * (c - a), 3 * (a - 2 * b + c), d - a + 3 * (b - c)

    def like(self, values: FloatArray) -> Path:
        """The same smoother put on other values of the same events, (n, 2)."""
        solved = cho_solve_banded((self.factor, True), self.gather @ values, check_finite=False)
        return replace(self, coefficients=solved)

    def by_lag(self, lag_s: FloatArray) -> FloatArray:
        """Covariance of the errors of one coordinate at two times that far apart, away from ends and gaps, mm²."""
        return looked_up(self._by_lag, lag_s / LAG_STEP_S)

    def excess_error(self, t_s: FloatArray, edge_of_s: FloatArray) -> FloatArray:
        """By how much the error at times (m,) is larger than far from ends and gaps, whose times are edge_of_s (k,)."""
        scale = np.ones(t_s.size)
        near = np.flatnonzero(np.abs(t_s[:, None] - edge_of_s[None, :]).min(1) < 1.0 / self.corner_hz)
        if near.size:
            first, weights = _bspline(t_s[near], self.start_s, self.step_s, self.coefficients.shape[0])
            basis = np.zeros((self.coefficients.shape[0], near.size), order="F")
            for j in range(4):
                basis[first + j, np.arange(near.size)] = weights[j]
            solved = cho_solve_banded((self.factor, True), basis, check_finite=False)
            variance = self.noise_mm**2 * (basis * solved).sum(0)
            scale[near] = np.sqrt(np.maximum(variance / self._by_lag[0], 1.0))
        return scale

    @cached_property
    def _by_lag(self) -> FloatArray:
        f_hz, kept = self._kept
        size = 2 * (f_hz.size - 1)
        return self.noise_mm**2 * self.dt_s / LAG_STEP_S * tapered(irfft(kept, size)[: size // 2], LAG_STEP_S)

    @cached_property
    def _kept(self) -> tuple[FloatArray, FloatArray]:
        """What the smoother lets through of each frequency."""
        f_hz = np.arange(LAG_POINTS // 2 + 1) / (LAG_POINTS * LAG_STEP_S)
        return f_hz, self.keeps(f_hz)

    def keeps(self, f_hz: FloatArray) -> FloatArray:
        """The share of each frequency that the smoother lets through."""
        at = _penalty_at_corner(np.array([self.corner_hz]), self.rhythm_hz)
        return 1 / (1 + _penalty(f_hz, self.rhythm_hz) / at)

    @property
    def speed_variance(self) -> float:
        """Variance of the error of one component of the velocity, (mm/s)²."""
        f_hz, kept = self._kept
        return float(self.noise_mm**2 * 2 * self.dt_s * f_hz[1] * np.sum((2 * np.pi * f_hz) ** 2 * kept))


def looked_up(table: FloatArray, position: FloatArray) -> FloatArray:
    """Linear interpolation in a table that is zero beyond its end; positions ≥ 0 in steps of the table."""
    position = np.minimum(position, table.size - 1.001)
    k = position.astype(np.int64)
    low = table[k]
    return np.asarray(low + (position - k) * (table[k + 1] - low))


def tapered(by_lag: FloatArray, step_s: float) -> FloatArray:
    """A table of autocovariances, zero from INDEPENDENT_S on, still a covariance (Parzen's window)."""
    u = step_s * np.arange(int(INDEPENDENT_S / step_s) + 2) / INDEPENDENT_S
    window = np.where(u < 0.5, 1 - 6 * u**2 * (1 - u), 2 * np.maximum(1 - u, 0.0) ** 3)
    out = np.zeros(u.size)
    k = min(u.size, by_lag.size)
    out[:k] = by_lag[:k] * window[:k]
    return out


def _penalty(f_hz: FloatArray, rhythm_hz: float) -> FloatArray:
    """Penalty by frequency: none at 0, at the rhythm, and at its third harmonic."""
    third = f_hz**2 - 9 * rhythm_hz**2 if rhythm_hz > 0 else 1.0
    return np.asarray((f_hz**2 * (f_hz**2 - rhythm_hz**2) ** 2 * third) ** 2)


def _penalty_at_corner(corner_hz: FloatArray, rhythm_hz: float) -> FloatArray:
    """The penalty at the corner; where the third harmonic is near, what goes on rising past it."""
    third = np.maximum(9 * rhythm_hz**2 - corner_hz**2, corner_hz**2 / 3) if rhythm_hz > 0 else 1.0
    return np.asarray((corner_hz**2 * (corner_hz**2 - rhythm_hz**2) ** 2 * third) ** 2)


def _bspline(t_s: FloatArray, start_s: float, step_s: float, n: int) -> tuple[IntArray, list[FloatArray]]:
    """Cubic B-splines on even knots: the first of four at each time, and their values."""
    position = (t_s - start_s) / step_s
    first = np.clip(position.astype(np.int64), 0, n - 4)
    u = position - first
    v = 1 - u
    u3 = u * u * u
    low = v * v * v / 6
    b = (3 * u3 - 6 * u * u + 4) / 6
    return first, [low, b, 1 - low - b - u3 / 6, u3 / 6]


def smooth_path(events: Events, rhythm_hz: float, corner_hz: float, noise_power: float) -> Path:
    """The penalised B-spline with that rhythm and corner. noise_power: mm²/Hz, one-sided, at the corner."""
    step_s = 1 / (KNOTS_PER_PERIOD * corner_hz)
    t_s = events.t_s
    start_s = float(t_s[0])
    n = int((t_s[-1] - start_s) / step_s) + 4
    n = max(n, 12)
    taps = np.array([1.0, -2.0, 1.0])
    for turn_hz in (rhythm_hz, rhythm_hz, 3 * rhythm_hz) if rhythm_hz > 0 else (0.0, 0.0):
        taps = np.convolve(taps, [1.0, -2 * np.cos(2 * np.pi * turn_hz * step_s), 1.0])
    first, weights = _bspline(t_s, start_s, step_s, n)
    bands = np.zeros((taps.size, n))
    for a in range(4):
        for b in range(a, 4):
            bands[b - a] += np.bincount(first + a, weights[a] * weights[b], n)
    strength = step_s / events.dt_s / float(_penalty_at_corner(np.array([corner_hz]), rhythm_hz)[0])
    strength /= (2 * np.pi * step_s) ** (2 * (taps.size - 1))
    rows = n - taps.size + 1
    for k in range(taps.size):
        for a in range(taps.size - k):
            bands[k, a : a + rows] += strength * taps[a] * taps[a + k]
    bands[0] += 1e-10 * step_s / events.dt_s
    factor = cholesky_banded(bands, lower=True, check_finite=False)
    column = first[:, None] + np.arange(4)
    row_starts = np.arange(0, 4 * t_s.size + 1, 4)
    gather = csc_array((np.stack(weights, axis=1).ravel(), column.ravel(), row_starts), shape=(n, t_s.size))
    coefficients = cho_solve_banded((factor, True), gather @ events.xy_mm, check_finite=False)
    noise_mm = float(np.sqrt(noise_power / (2 * events.dt_s)))
    # Independent values of the spectrum that the noise below the corner is continued from; continuing halves them.
    noise_dof = 0.5 * max(NOISE_UP_TO_HZ - corner_hz, 1.0) * float(t_s[-1] - t_s[0])
    noise_dof = max(noise_dof, 3.0)
    return Path(
        start_s=start_s,
        step_s=step_s,
        coefficients=coefficients,
        factor=factor,
        noise_mm=noise_mm,
        rhythm_hz=rhythm_hz,
        corner_hz=corner_hz,
        noise_dof=noise_dof,
        dt_s=events.dt_s,
        gather=gather,
    )
