"""A simulated participant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from draglag.protocol.targets import Target
from draglag.simulation.kinematics import GRID_HZ, FloatArray, Motion, grid, motion_of


@dataclass(frozen=True)
class Human:
    """A participant's errors; standard deviations unless said otherwise.

    Attributes:
        lag_s: mean delay behind the target.
        timing_sd_s: of the lag, which varies slowly.
        wander_mm, wander_hz: slow error of position per axis, and its bandwidth.
        tremor_mm: per axis, 8–12 Hz.
        gain_sd: of the figure's size, per axis.
        touch_s: earliest and latest touch.
    """

    lag_s: float = 0.08
    timing_sd_s: float = 0.02
    wander_mm: float = 1.5
    wander_hz: float = 0.5
    tremor_mm: float = 0.05
    gain_sd: float = 0.02
    touch_s: tuple[float, float] = (0.2, 0.5)


PERFECT = Human(0.0, 0.0, 0.0, 0.5, 0.0, 0.0, (0.0, 0.0))
"""Follows exactly: the motion is the target."""


@cache
def _sections(low_hz: float | None, high_hz: float) -> FloatArray:
    from scipy.signal import butter

    band = high_hz if low_hz is None else (low_hz, high_hz)
    return np.asarray(butter(2, band, "low" if low_hz is None else "band", fs=GRID_HZ, output="sos"))


def _band_noise(rng: np.random.Generator, n: int, low_hz: float | None, high_hz: float, sd: float) -> FloatArray:
    from scipy.signal import sosfiltfilt

    white = rng.standard_normal(n + int(4 * GRID_HZ))  # the surplus keeps the filter's ends out
    if sd == 0:
        return np.zeros(n)
    shaped = np.asarray(sosfiltfilt(_sections(low_hz, high_hz), white))
    return np.asarray(shaped[int(2 * GRID_HZ) :][:n] * (sd / shaped.std()))


def follow(target: Target, human: Human, rng: np.random.Generator) -> Motion:
    """Motion of ``human`` following ``target``."""
    t = grid(target.duration_s)
    n = len(t)
    delay = human.lag_s + _band_noise(rng, n, None, 0.4, human.timing_sd_s)
    # Before its start the target waits where it begins, and the hand with it.
    x, y = target.position_mm(np.clip(t - delay, 0.0, target.duration_s))
    gain_x, gain_y = 1 + human.gain_sd * rng.standard_normal(2)
    trend = np.polynomial.Polynomial.fit(t, x, 1)(t)
    x = trend + gain_x * (x - trend)
    y = y.mean() + gain_y * (y - y.mean())
    for axis in (x, y):
        axis += _band_noise(rng, n, None, human.wander_hz, human.wander_mm)
        axis += _band_noise(rng, n, 8.0, 12.0, human.tremor_mm)
    return motion_of(t, x, y, _contact(t, human, rng))


def _contact(t: FloatArray, human: Human, rng: np.random.Generator) -> NDArray[np.bool_]:
    return t >= rng.uniform(*human.touch_s)
