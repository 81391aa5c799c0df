"""The stylus' acceleration where the latency depends on it.

If the latency grows by c·a, traces show u = v / (1 + c·ȧ) ≈ v − v₀ c·ȧ, with a = G v̇ as the tracker smooths it; so a =
iω G u / (1 + v₀ c ω² G).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.fft import irfft, rfft

from draglag.gap.constants import HAND_STEP_S, PADDED_S
from draglag.numerics import fast_length
from draglag.path.events import sample_interval_s
from draglag.path.local_fit import local_fit
from draglag.recording import FloatArray

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

# Half the window of a speed, and half the span of a change of speed: a hand speeds up and slows down at 1–4 Hz, its
# tremor is at 8–12 Hz (physical). Both at most this share of the time in which the path turns by one radian.
WIDTH_S, APART_S = 0.18, 0.05
TURNING = 0.7


@dataclass(frozen=True)
class Shown:
    """Speed of a trace without tremor, (g,). apart_s: half span of its change."""

    grid_s: FloatArray
    step_s: float
    speed_mm_s: FloatArray
    apart_s: float


@dataclass(frozen=True)
class Spectrum:
    """Deviations of a trace's speed from its mean: values (f,) at omega (f,), of a grid that is padded to ``size``."""

    grid_s: FloatArray
    mean_mm_s: float
    inside: slice
    size: int
    omega: FloatArray
    values: np.ndarray


@dataclass(frozen=True)
class Acceleration:
    """Tangential acceleration and its rate, (m,)."""

    setting: tuple[float, float]
    accel_mm_s2: FloatArray
    change_mm_s3: FloatArray


@dataclass(frozen=True)
class DewarpedKinematics:
    """A ``residual.Trace``. run: (m,) index; at_s: (m,) touch time; known: cached."""

    runs: tuple[RunData, ...]
    run: np.ndarray
    at_s: FloatArray
    known: Acceleration | None = None

    def __getitem__(self, use: np.ndarray) -> DewarpedKinematics:
        a = self.known
        known = None if a is None else replace(a, accel_mm_s2=a.accel_mm_s2[use], change_mm_s3=a.change_mm_s3[use])
        return replace(self, run=self.run[use], at_s=self.at_s[use], known=known)

    def accelerated(self, lag_s3_mm: float, window_s: float) -> DewarpedKinematics:
        """See ``Trace``."""
        setting = lag_s3_mm, window_s
        return replace(self, known=Acceleration(setting, *self.acceleration(*setting)))

    def acceleration(self, lag_s3_mm: float, window_s: float) -> tuple[FloatArray, FloatArray]:
        """See ``Trace``."""
        if self.known is not None and self.known.setting == (lag_s3_mm, window_s):
            return self.known.accel_mm_s2, self.known.change_mm_s3
        out, change = np.zeros(self.at_s.size), np.zeros(self.at_s.size)
        for k in np.unique(self.run):
            speed, own = self.runs[k].spectrum, self.run == k
            smooth = np.exp(-0.5 * (speed.omega * window_s) ** 2)
            amplified = 1 + max(speed.mean_mm_s * lag_s3_mm, 0.0) * speed.omega**2 * smooth
            of = speed.values * 1j * speed.omega * smooth / amplified
            at_grid = irfft([of, of * (1j * speed.omega)], speed.size)[:, speed.inside]
            out[own], change[own] = (np.interp(self.at_s[own], speed.grid_s, values) for values in at_grid)
        return out, change

    def earlier(self, before_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See ``Trace``; negative: after the edge."""
        speed, change = np.zeros(self.at_s.size), np.zeros(self.at_s.size)
        for k in np.unique(self.run):
            shown, own = self.runs[k].shown, self.run == k
            at = self.at_s[own] - before_s[own]
            apart_s = shown.apart_s
            slower, now, faster = (
                np.interp(at + aside, shown.grid_s, shown.speed_mm_s) for aside in (-apart_s, 0.0, apart_s)
            )
            speed[own], change[own] = now, (faster - slower) / (2 * apart_s)
        return speed, change


def spectrum_of(quick: tuple[FloatArray, FloatArray], mean_mm_s: float) -> Spectrum:
    """Spectrum of speeds on a regular grid, (g,), (g,), mirrored at their ends."""
    grid_s, speed_mm_s = quick
    n, step_s = grid_s.size, float(grid_s[1] - grid_s[0])
    edge = min(round(PADDED_S / step_s), n - 1)
    size = fast_length(n + 2 * edge)
    padded = np.pad(speed_mm_s - mean_mm_s, (edge, size - n - edge), mode="reflect")
    omega = np.asarray(2 * np.pi * np.fft.rfftfreq(size, step_s), float)
    return Spectrum(grid_s, mean_mm_s, slice(edge, edge + n), size, omega, rfft(padded))


def shown_speed(t_s: FloatArray, xy_mm: FloatArray, radius_mm: float | None, mean_mm_s: float | None) -> Shown:
    """Speed of a trace. radius_mm, mean_mm_s: of a steady circle."""
    interval_s = sample_interval_s(t_s)
    step_s = max(interval_s, HAND_STEP_S)
    grid_s = np.arange(t_s[0], t_s[-1], step_s)
    turning_s = TURNING * radius_mm / mean_mm_s if mean_mm_s and radius_mm else np.inf
    fit = local_fit(t_s, xy_mm, grid_s, max(min(WIDTH_S, turning_s), 4.5 * interval_s), degree=2, roundness=3)
    speed = np.interp(grid_s, grid_s[fit.ok], fit.speed_mm_s[fit.ok]) if fit.ok.any() else np.zeros(grid_s.size)
    return Shown(grid_s, step_s, speed, float(min(APART_S, turning_s)))
