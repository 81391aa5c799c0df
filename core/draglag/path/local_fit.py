"""Local polynomial fits to events."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from draglag.recording import FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

IN_CACHE = 16384  # numbers that are worked on at once
DEGREE = 3  # cubic: unbiased for constant jerk, and odd orders cost nothing at the centre of a window
RIDGE = 1e-12  # of a system's trace: events at too few times have no solution of their own
EVEN_MOMENTS = np.where(np.arange(9) % 2, 0.0, 1 / np.arange(1, 10))  # of evenly filled windows without weights


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows about m times: ``count`` events from ``first`` on, at most ``size``, weighted by (1 − u²)^roundness."""

    t_s: FloatArray
    at_s: FloatArray
    width_s: FloatArray
    first: IntArray
    count: IntArray
    size: int
    roundness: int

    @cached_property
    def whole(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """``part`` of all windows."""
        return self.part(slice(None))

    def part(self, part: slice) -> tuple[IntArray, FloatArray, FloatArray]:
        """Events, times u from the middle in half widths, and weights of some windows, (size, q)."""
        place = np.arange(self.size)[:, None]
        index = np.minimum(self.first[part] + place, self.t_s.size - 1)
        u = self.t_s.take(index)
        u -= self.at_s[part]
        u /= self.width_s[part]
        kernel = u * u
        np.subtract(1.0, kernel, out=kernel)
        kernel *= (kernel > 0) & (place < self.count[part])
        return index, u, kernel if self.roundness == 1 else kernel**self.roundness


@dataclass(frozen=True, eq=False)
class FitWeights:
    """Contribution of each event of a window to local fits at m times, (m, w) each.

    moments: (2 degree + 1, m) weighted sums of powers of u.
    """

    windows: Windows
    moments: FloatArray

    @cached_property
    def position(self) -> FloatArray:
        return self._of_power(0)

    @cached_property
    def velocity(self) -> FloatArray:
        return self._of_power(1) / self.windows.width_s[:, None]

    @cached_property
    def acceleration(self) -> FloatArray:
        return 2 * self._of_power(2) / self.windows.width_s[:, None] ** 2

    def _of_power(self, power: int) -> FloatArray:
        unit = np.zeros((self.moments.shape[0] // 2 + 1, 1, self.moments.shape[1]))
        unit[power] = 1.0
        _, u, kernel = self.windows.whole
        coefficients = solve_hankel(self.moments, unit)[:, 0]
        out = np.multiply(u, coefficients[-1])
        for coefficient in coefficients[-2:0:-1]:
            out += coefficient
            out *= u
        out += coefficients[0]
        out *= kernel
        return np.ascontiguousarray(out.T)


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
    """Polynomial fits within ``half_width_s`` (scalar or (m,)) of each time. degree: 2 or more.

    ``roundness``: power of the weights 1 − u²; 1 (Epanechnikov) is best for white noise, 3 has low side lobes.
    """
    width_s = np.full(at_s.size, half_width_s, float)
    first = t_s.searchsorted(at_s - width_s, side="right")
    last = t_s.searchsorted(at_s + width_s, side="left")
    middle, count = t_s.searchsorted(at_s), last - first
    size = max(int(np.max(count, initial=1)), degree + 1)
    windows = Windows(t_s, at_s, width_s, first.astype(np.int64), count, size, roundness)
    moments, of_xy = _moments(windows, xy_mm, degree)
    # Inside a window of half width h the events must reach to both sides, or the fit extrapolates.
    ok = (count >= degree + 2) & (middle >= first + 2) & (middle <= last - 2)
    if not ok.all():
        moments[:, ~ok] = EVEN_MOMENTS[: 2 * degree + 1, None]
    xy_mm, v, half_a, *_ = solve_hankel(moments, of_xy).transpose(0, 2, 1)
    own_s, by_event = width_s[:, None], FitWeights(windows, moments)
    return LocalFit(at_s, xy_mm, v / own_s, 2 * half_a / own_s**2, windows.first, by_event, ok)


def _moments(windows: Windows, xy_mm: FloatArray, degree: int) -> tuple[FloatArray, FloatArray]:
    """Weighted sums of the powers of u, (2 degree + 1, m), and of those times x and y, (degree + 1, 2, m)."""
    m = windows.at_s.size
    moments, of_xy = np.empty((2 * degree + 1, m)), np.empty((degree + 1, 2, m))
    x_mm, y_mm = np.ascontiguousarray(xy_mm.T)
    step = max(IN_CACHE // windows.size, 1)
    for part in (slice(begin, begin + step) for begin in range(0, m, step)):
        index, u, kernel = windows.whole if step >= m else windows.part(part)
        x, y, product, power = x_mm.take(index), y_mm.take(index), np.empty_like(u), kernel.copy()
        for order in range(2 * degree + 1):
            power.sum(0, out=moments[order, part])
            if order <= degree:
                np.multiply(power, x, out=product).sum(0, out=of_xy[order, 0, part])
                np.multiply(power, y, out=product).sum(0, out=of_xy[order, 1, part])
            power *= u
    return moments, of_xy


def solve_hankel(moments: FloatArray, sides: FloatArray) -> FloatArray:
    """Solutions (p, k, m) of m systems with the elements a_ij = moments_(i + j), (2p − 1, m), positive definite."""
    p, k, m = sides.shape
    rows = np.empty((p, p + k, m))  # each system next to its right sides
    rows[:, :p] = moments[np.arange(p)[:, None] + np.arange(p)]
    rows[:, p:] = sides
    rows[np.arange(p), np.arange(p)] += RIDGE * moments[::2].sum(0)
    for i in range(p - 1):
        share = rows[i + 1 :, i] / rows[i, i]
        rows[i + 1 :, i + 1 :] -= share[:, None] * rows[i, i + 1 :]
    x = rows[:, p:]
    for i in reversed(range(p)):
        x[i] /= rows[i, i]
        x[:i] -= rows[:i, i, None] * x[i]
    return x
