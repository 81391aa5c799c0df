"""The stylus' path from touch events, by a smoother matched to their spectrum."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.fft import irfft
from numpy.typing import NDArray
from scipy.linalg.lapack import dpbtrf, dpbtrs

from draglag.latency.spectrum import NOISE_UP_TO_HZ, Events, penalty, penalty_at_corner
from draglag.recording import FloatArray, IntArray

KNOTS_PER_PERIOD = 10.0  # of the corner frequency
INDEPENDENT_S = 3.0  # edges further apart share no error
LAG_STEP_S, LAG_POINTS = 0.005, 2048  # of the table of covariances


@dataclass(frozen=True)
class Path:
    """The smoothed path on even knots.

    ``factor``: banded Cholesky factor of the normal equations; ``noise_mm``: standard deviation of an event, were its
    noise everywhere as below the corner; ``first``, ``weights``: of the splines at each event, (n,) and
    (4, n).
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
    first: IntArray = field(repr=False)
    weights: FloatArray = field(repr=False)

    def at(self, t_s: FloatArray, order: int = 0) -> FloatArray:
        """Position (order 0), velocity (1) or acceleration (2) at times of any shape, (..., 2)."""
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
        """Position and velocity, (..., 2) each."""
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
        whole = np.asarray(self.coefficients[:, 0] + 1j * self.coefficients[:, 1], np.complex128)
        a, b, c, d = (whole[j : whole.size - 3 + j] / 6 for j in range(4))
        return a + 4 * b + c, 3 * (c - a), 3 * (a - 2 * b + c), d - a + 3 * (b - c)

    def like(self, values: FloatArray) -> Path:
        """The same smoother on other values (n, 2)."""
        return replace(
            self,
            coefficients=_solved(self.factor, _gathered(self.first, self.weights, values, self.coefficients.shape[0])),
        )

    def by_lag(self, lag_s: FloatArray) -> FloatArray:
        """Autocovariance of one coordinate's error away from ends and gaps, mm²."""
        return looked_up(self._by_lag, lag_s / LAG_STEP_S)

    def excess_error(self, t_s: FloatArray, edge_of_s: FloatArray) -> FloatArray:
        """Ratio (m,) of the error at t_s to that far from ends and gaps, at edge_of_s (k,)."""
        scale = np.ones(t_s.size)
        near = np.flatnonzero(np.abs(t_s[:, None] - edge_of_s[None, :]).min(1) < 1.0 / self.corner_hz)
        if near.size:
            first, weights = _bspline(t_s[near], self.start_s, self.step_s, self.coefficients.shape[0])
            basis = np.zeros((self.coefficients.shape[0], near.size), order="F")
            for j in range(4):
                basis[first + j, np.arange(near.size)] = weights[j]
            variance = self.noise_mm**2 * (basis * _solved(self.factor, basis)).sum(0)
            scale[near] = np.sqrt(np.maximum(variance / self._by_lag[0], 1.0))
        return scale

    @cached_property
    def _by_lag(self) -> FloatArray:
        f_hz, kept = self._kept
        size = 2 * (f_hz.size - 1)
        return self.noise_mm**2 * self.dt_s / LAG_STEP_S * tapered(irfft(kept, size)[: size // 2], LAG_STEP_S)

    @cached_property
    def _kept(self) -> tuple[FloatArray, FloatArray]:
        f_hz = np.arange(LAG_POINTS // 2 + 1) / (LAG_POINTS * LAG_STEP_S)
        return f_hz, self.keeps(f_hz)

    def keeps(self, f_hz: FloatArray) -> FloatArray:
        """Gain at each frequency."""
        at = penalty_at_corner(np.array([self.corner_hz]), self.rhythm_hz)
        return 1 / (1 + penalty(f_hz, self.rhythm_hz) / at)

    @property
    def speed_variance(self) -> float:
        """Error variance of one component of the velocity, (mm/s)²."""
        f_hz, kept = self._kept
        return float(self.noise_mm**2 * 2 * self.dt_s * f_hz[1] * np.sum((2 * np.pi * f_hz) ** 2 * kept))


def looked_up(table: FloatArray, position: FloatArray) -> FloatArray:
    """Linear interpolation at positions ≥ 0 in a table's steps, zero beyond it."""
    position = np.minimum(position, table.size - 1.001)
    k = position.astype(np.int64)
    low = table[k]
    return np.asarray(low + (position - k) * (table[k + 1] - low))


def tapered(by_lag: FloatArray, step_s: float) -> FloatArray:
    """Autocovariances, zero from INDEPENDENT_S on, still positive semidefinite (Parzen's window)."""
    u = step_s * np.arange(int(INDEPENDENT_S / step_s) + 2) / INDEPENDENT_S
    window = np.where(u < 0.5, 1 - 6 * u**2 * (1 - u), 2 * np.maximum(1 - u, 0.0) ** 3)
    out = np.zeros(u.size)
    k = min(u.size, by_lag.size)
    out[:k] = by_lag[:k] * window[:k]
    return out


def _bspline(t_s: FloatArray, start_s: float, step_s: float, n: int) -> tuple[IntArray, FloatArray]:
    position = (t_s - start_s) / step_s
    first = np.clip(position.astype(np.int64), 0, n - 4)
    u = position - first
    v = 1 - u
    u3 = u * u * u
    low = v * v * v / 6
    b = (3 * u3 - 6 * u * u + 4) / 6
    return first, np.stack([low, b, 1 - low - b - u3 / 6, u3 / 6])


def _gathered(first: IntArray, weights: FloatArray, values: FloatArray, n: int) -> FloatArray:
    """Sums over the events of splines times values (n, 2), (k, 2)."""
    out = np.zeros((n, 2), order="F")
    for a in range(4):
        for axis in range(2):
            out[:, axis] += np.bincount(first + a, weights[a] * values[:, axis], n)
    return out


def _solved(factor: FloatArray, values: FloatArray) -> FloatArray:
    """LAPACK directly: scipy's checks cost more than a short run."""
    return np.asarray(dpbtrs(factor, values, lower=1)[0], float)


def _factor(events: FloatArray, taps: FloatArray, strength: float, ridge: float) -> FloatArray:
    """Banded Cholesky factor; the penalty ends at long holes, where it is singular."""
    n = events.shape[1]
    try:
        return _penalised(events, taps, np.full(n - taps.size + 1, strength), ridge)
    except np.linalg.LinAlgError:
        near = np.convolve(events[0] > 0, np.ones(taps.size), mode="valid") > 0
        return _penalised(events, taps, np.where(near, strength, 0.0), ridge)


def _penalised(events: FloatArray, taps: FloatArray, strength: FloatArray, ridge: float) -> FloatArray:
    bands = events.copy()
    for k in range(taps.size):
        for a in range(taps.size - k):
            bands[k, a : a + strength.size] += strength * taps[a] * taps[a + k]
    bands[0] += ridge
    factor, bad = dpbtrf(np.asfortranarray(bands), lower=1, overwrite_ab=1)
    if bad:
        raise np.linalg.LinAlgError("the path's normal equations are not positive definite")
    return np.asarray(factor)


def smooth_path(events: Events, rhythm_hz: float, corner_hz: float, noise_power: float) -> Path:
    """The B-spline with penalty D²(D² + ω²)²(D² + 9ω²). noise_power: mm²/Hz, one-sided, at the corner.

    Straight lines, the run's rhythm ω and 3ω (an oval under a speed-dependent latency) cost nothing.
    """
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
    strength = step_s / events.dt_s / float(penalty_at_corner(np.array([corner_hz]), rhythm_hz)[0])
    strength /= (2 * np.pi * step_s) ** (2 * (taps.size - 1))
    factor = _factor(bands, taps, strength, 1e-10 * step_s / events.dt_s)
    coefficients = _solved(factor, _gathered(first, weights, events.xy_mm, n))
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
        first=first,
        weights=weights,
    )
