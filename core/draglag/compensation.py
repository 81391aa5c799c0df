"""Putting a latency law to work on recorded touch data: when, and so where, the stylus really was."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from draglag.motion import local_fit
from draglag.recording import FloatArray

Law = Callable[[FloatArray], FloatArray]


def stylus_speed(law: Law, v_mm_s: FloatArray, a_mm_s2: FloatArray) -> FloatArray:
    """Speed of the stylus itself behind an event's shown velocity and acceleration, (m,) mm/s.

    The law re-times the trace: an event at t + L(v(t)) runs 1 + L′(v)·v̇ times slower than the stylus, which matters
    where L falls steeply.

    Args:
        v_mm_s, a_mm_s2: (m, 2) as the touch trace shows them.
    """
    shown = np.maximum(np.hypot(v_mm_s[:, 0], v_mm_s[:, 1]), 1e-6)
    along = np.einsum("mk,mk->m", v_mm_s, a_mm_s2) / shown
    speed = shown
    for _ in range(3):
        below = np.maximum(speed - 0.5, 0)
        slope = (law(speed + 0.5) - law(below)) / (speed + 0.5 - below)
        speed = shown * np.clip(1 + slope * along, 0.6, 1.6)
    return speed


def stylus_time_s(t_s: FloatArray, xy_mm: FloatArray, at_s: FloatArray, law: Law, half_s: float) -> FloatArray:
    """When the stylus was where the trace shows it at ``at_s``: at_s − L(v), never running backwards, (m,) s.

    Args:
        t_s: (n,) increasing. xy_mm: (n, 2). at_s: (m,) increasing. half_s: half width of the local fits.
    """
    fit = local_fit(t_s, xy_mm, at_s, half_s)
    latency_s = np.where(fit.ok, law(stylus_speed(law, fit.v_mm_s, fit.a_mm_s2)), np.nan)
    good = np.isfinite(latency_s)
    if not good.any():
        return np.full(at_s.shape, np.nan)
    latency_s = np.interp(at_s, at_s[good], latency_s[good])
    # A law that falls steeply can fold time where the stylus starts: both running extremes, averaged, are monotone.
    time_s = at_s - latency_s
    forward = np.maximum.accumulate(time_s)
    backward = np.minimum.accumulate(time_s[::-1])[::-1]
    return 0.5 * (forward + backward)
