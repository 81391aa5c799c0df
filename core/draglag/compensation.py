"""Putting a latency law to work on recorded touch data: when, and so where, the stylus really was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from draglag.errors import DataError
from draglag.motion import contact_losses, in_contact, local_fit, sample_interval_s, usable
from draglag.recording import FloatArray, TouchTrace

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


@dataclass(frozen=True)
class Compensated:
    """Recorded touch events with the lag taken out; (n,) in the order given, NaN where nothing can be said.

    Attributes:
        stylus_t_s: when the stylus was where the event shows it; never runs backwards.
        latency_s: t_s − stylus_t_s.
        speed_mm_s: of the stylus, at stylus_t_s.
        x_stylus_mm, y_stylus_mm: where the stylus was at t_s itself, which later events tell.
        extrapolated: bool, the speed lies outside the model's measured range.
    """

    t_s: FloatArray
    stylus_t_s: FloatArray
    latency_s: FloatArray
    speed_mm_s: FloatArray
    x_stylus_mm: FloatArray
    y_stylus_mm: FloatArray
    extrapolated: np.ndarray
    moved_mm: FloatArray

    def report(self) -> dict[str, object]:
        """What was changed, in numbers for JSON."""
        known, placed = np.isfinite(self.latency_s), np.isfinite(self.moved_mm)
        latency_ms, moved = 1e3 * self.latency_s[known], self.moved_mm[placed]

        def spread(values: FloatArray) -> list[float] | None:
            return [float(v) for v in np.percentile(values, [0, 50, 100])] if values.size else None

        return {
            "n_events": int(self.t_s.size),
            "n_retimed": int(np.count_nonzero(known)),
            "n_placed": int(np.count_nonzero(placed)),
            "n_extrapolated": int(np.count_nonzero(self.extrapolated & known)),
            "latency_ms_min_median_max": spread(latency_ms),
            "moved_mm_min_median_max": spread(moved),
            "moved_rms_mm": float(np.sqrt(np.mean(moved**2))) if moved.size else None,
        }


def compensate(
    t_s: FloatArray,
    x_mm: FloatArray,
    y_mm: FloatArray,
    law: Law,
    speed_range_mm_s: tuple[float, float] = (0.0, np.inf),
) -> Compensated:
    """Where the stylus really was behind recorded touch events.

    Args:
        t_s, x_mm, y_mm: (n,) events; rows with NaN stay NaN, rows out of order are used in the order of time.
        law: L(v), s. speed_range_mm_s: where it was measured; speeds outside are marked.

    Raises DataError with fewer than eight usable events or arrays of different length.
    """
    t_s, x_mm, y_mm = (np.asarray(v, float) for v in (t_s, x_mm, y_mm))
    if not t_s.shape == x_mm.shape == y_mm.shape or t_s.ndim != 1:
        raise DataError("times and positions differ in number", "Give one t, x and y for each event")
    touch = usable(TouchTrace(t_s, x_mm, y_mm))
    if touch.t_s.size < 8:
        raise DataError(f"{touch.t_s.size} usable touch events are too few", "Give at least eight with finite t, x, y")
    xy_mm = np.column_stack([touch.x_mm, touch.y_mm])
    half_s = max(0.05, 4.5 * sample_interval_s(touch.t_s))
    own_s = stylus_time_s(touch.t_s, xy_mm, touch.t_s, law, half_s)
    if not np.isfinite(own_s).all():
        raise DataError("no stretch of the events is long enough to tell a speed", "Give an uninterrupted recording")
    fit = local_fit(touch.t_s, xy_mm, touch.t_s, half_s)
    speed = np.where(fit.ok, stylus_speed(law, fit.v_mm_s, fit.a_mm_s2), np.nan)
    forwards = np.append(np.diff(own_s) > 0, True)
    losses_s = contact_losses(touch.t_s)
    shown_s = np.interp(touch.t_s, own_s[forwards], touch.t_s[forwards], left=np.nan, right=np.nan)
    placed = np.isfinite(shown_s) & in_contact(touch.t_s, np.where(np.isfinite(shown_s), shown_s, -np.inf), losses_s)
    moved_to = [np.where(placed, np.interp(shown_s, touch.t_s, v), np.nan) for v in (touch.x_mm, touch.y_mm)]
    good = np.isfinite(t_s) & np.isfinite(x_mm) & np.isfinite(y_mm)
    index = np.clip(np.searchsorted(touch.t_s, t_s), 0, touch.t_s.size - 1)

    def rows(values: FloatArray) -> FloatArray:
        return np.where(good, values[index], np.nan)

    x_own, y_own = rows(moved_to[0]), rows(moved_to[1])
    v = rows(speed)
    outside = (v < speed_range_mm_s[0]) | (v > speed_range_mm_s[1])
    return Compensated(
        t_s,
        rows(own_s),
        rows(touch.t_s - own_s),
        v,
        x_own,
        y_own,
        outside,
        np.hypot(x_own - x_mm, y_own - y_mm),
    )
