"""Putting a latency law to work on recorded touch data: when, and so where, the stylus really was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import savgol_filter

from draglag.errors import DataError
from draglag.motion import contact_losses, in_contact, local_fit, sample_interval_s, usable
from draglag.recording import FloatArray, TouchTrace

Law = Callable[[FloatArray], FloatArray]

GRID_S = 0.004  # of the stylus' own time: touch events are no closer
HALVES_S = (0.05, 0.07, 0.1, 0.15, 0.2, 0.25)  # of the smoothing window: short at speed, wide where the law is steep
STEEP_S = 0.03  # v · L′(v) from which simulated Screens 1 and 2 are better undone as a whole
PAUSE_S = 2.0  # what lies further apart is not one movement


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
class StylusPath:
    """The stylus' movement as a law and a touch trace imply it, on an even grid of its own time.

    Attributes: t_s (g,), xy_mm (g, 2), speed_mm_s (g,), arrival_s (g,) when the screen shows each point;
    event_t_s (n,) when the stylus was where each event shows it, never running backwards.
    """

    t_s: FloatArray
    xy_mm: FloatArray
    speed_mm_s: FloatArray
    arrival_s: FloatArray
    event_t_s: FloatArray

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Latency s (m,), speed mm/s (m,) and position mm (m, 2) at times t_s (m,)."""
        xy_mm = np.column_stack([np.interp(t_s, self.t_s, column) for column in self.xy_mm.T])
        latency_s = np.interp(t_s, self.t_s, self.arrival_s) - t_s
        return latency_s, np.interp(t_s, self.t_s, self.speed_mm_s), xy_mm


def stylus_path(t_s: FloatArray, xy_mm: FloatArray, law: Law, half_s: float = 0.15, rounds: int = 4) -> StylusPath:
    """Undo a law: find the movement whose delayed image is the touch trace.

    Where the stylus starts, L may fall faster than time passes: fresher news overtakes older, and the trace jumps.
    Inverting L event by event has no answer there. So the movement is guessed on a grid of the stylus' own time, sent
    through the law the way the screen does it (a position arrives with the first newer one, never after it), and each
    event is moved to the time whose image it is; a few rounds settle, and many let noise grow where
    the law is steep.

    Args:
        t_s: (n,) increasing stamps. xy_mm: (n, 2). half_s: half width of the window for position and speed.
    """
    own_s = stylus_time_s(t_s, xy_mm, t_s, law, max(0.05, 4.5 * sample_interval_s(t_s)))
    if not np.isfinite(own_s).all():
        own_s = t_s - float(law(np.array([200.0]))[0])
    reach = max(3, round(half_s / GRID_S))
    slowest_s = float(law(np.zeros(1))[0])
    grid_s = np.arange(min(own_s[0], t_s[0] - slowest_s), t_s[-1], GRID_S)
    for round_ in range(rounds):
        xy_grid, speed = _on_grid(own_s, xy_mm, grid_s, reach)
        arrival_s = grid_s + law(speed)
        arrival_s = np.minimum.accumulate(arrival_s[::-1])[::-1] + 1e-12 * np.arange(grid_s.size)
        step_s = np.interp(t_s, arrival_s, grid_s) - own_s
        own_s = own_s + (0.5 if round_ < rounds - 2 else 1.0) * step_s
        own_s = np.maximum.accumulate(own_s)
    xy_grid, speed = _on_grid(own_s, xy_mm, grid_s, reach)
    return StylusPath(grid_s, xy_grid, speed, arrival_s, own_s)


def _on_grid(own_s: FloatArray, xy_mm: FloatArray, grid_s: FloatArray, reach: int) -> tuple[FloatArray, FloatArray]:
    """Position between the events by monotone cubics, then smoothed; speed from the same smoothing."""
    # Events of one moment are one event: their mean.
    slot = np.round((own_s - grid_s[0]) / GRID_S).astype(np.int64)
    _, group = np.unique(slot, return_inverse=True)
    count = np.bincount(group)
    at_s = np.bincount(group, own_s) / count
    columns = [np.bincount(group, column) / count for column in xy_mm.T]
    inside = np.clip(grid_s, at_s[0], at_s[-1])
    filled = np.column_stack([PchipInterpolator(at_s, column)(inside) for column in columns])
    window = 2 * reach + 1
    smooth = savgol_filter(filled, window, 3, axis=0)
    velocity = savgol_filter(filled, window, 3, deriv=1, delta=GRID_S, axis=0)
    return smooth, np.hypot(velocity[:, 0], velocity[:, 1])


def settled_path(t_s: FloatArray, xy_mm: FloatArray, law: Law) -> StylusPath | None:
    """The movement (``stylus_path``) with the smoothing whose delayed image is nearest to the trace; None where the
    events (n,) are fewer than eight or too short a stretch for any."""
    best, best_mm2 = None, np.inf
    for half_s in HALVES_S if t_s.size >= 8 else ():
        if 2 * half_s + 2 * GRID_S > t_s[-1] - t_s[0]:
            break
        path = stylus_path(t_s, xy_mm, law, half_s)
        shown_mm = np.column_stack([np.interp(t_s, path.arrival_s, column) for column in path.xy_mm.T])
        apart_mm2 = float(np.mean((shown_mm - xy_mm) ** 2))
        if apart_mm2 < best_mm2:
            best, best_mm2 = path, apart_mm2
    return best


def _is_steep(law: Law, speed_mm_s: FloatArray) -> bool:
    """Whether an error of speed moves these events far: v · L′(v), by which a relative error of v becomes one of time.

    Where it does, events can only be inverted together; where it does not, one by one is exact and smooths nothing.
    """
    speed = speed_mm_s[np.isfinite(speed_mm_s)]
    if not speed.size:
        return False
    slope = (law(1.02 * speed) - law(0.98 * speed)) / 0.04
    return float(np.percentile(np.abs(slope), 90)) > STEEP_S


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
    moved_to = [np.full(touch.t_s.shape, np.nan) for _ in range(2)]
    for one in np.split(np.arange(touch.t_s.size), np.flatnonzero(np.diff(touch.t_s) > PAUSE_S) + 1):
        if _is_steep(law, speed[one]) and (path := settled_path(touch.t_s[one], xy_mm[one], law)) is not None:
            own_s[one] = path.event_t_s
            speed[one] = np.where(fit.ok[one], np.interp(path.event_t_s, path.t_s, path.speed_mm_s), np.nan)
            for values, column in zip(moved_to, path.xy_mm.T, strict=True):
                values[one] = np.interp(touch.t_s[one], path.t_s, column)
    own_s = np.maximum.accumulate(own_s)
    forwards = np.append(np.diff(own_s) > 0, True)
    losses_s = contact_losses(touch.t_s)
    shown_s = np.interp(touch.t_s, own_s[forwards], touch.t_s[forwards], left=np.nan, right=np.nan)
    placed = np.isfinite(shown_s) & in_contact(touch.t_s, np.where(np.isfinite(shown_s), shown_s, -np.inf), losses_s)
    for values, shown in zip(moved_to, xy_mm.T, strict=True):
        # Stretches too short for a path: where the trace shows what it showed then.
        values[:] = np.where(np.isfinite(values), values, np.interp(shown_s, touch.t_s, shown))
        values[~placed] = np.nan
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
