"""Positions that a panel or a host interpolates between slower scans."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.gap.constants import SIZE_OF_INTEREST_MM
from draglag.gap.streams.stamps import Streams
from draglag.latency.spectrum import events_of
from draglag.latency.steady import has_constant_speed
from draglag.path.local_fit import local_fit
from draglag.recording import FloatArray, Session, TouchTrace

MOST_A_SCAN = 16  # reports. Physical: 60 Hz scans and 1000 Hz reports
FEWEST = 30  # bends at each place between two scans: their mean square is known to a fifth. Derived
SMALLER = 4.0
"""How many times as large as between scans squared bends at scans have to be: noise bends those, rounding alone the
others. Calibrated: of 244 kept sessions of two generators without interpolated reports none has 2."""
CURVED_S = 0.05  # half window of an acceleration: no hand curves a path within less. Physical


def is_interpolated(session: Session) -> bool:
    """Whether chords between scans lie off the path of steady runs by a size of interest, RMS."""
    touches = [run.touch for run in session.runs if has_constant_speed(run)]
    n = reports_a_scan(touches)
    if n == 1:
        return False
    moved_mm = np.concatenate([_off_chord_mm(touch, n) for touch in touches if touch.t_s.size > FEWEST * n])
    return moved_mm.size > 0 and float(np.sqrt(np.mean(moved_mm**2))) > SIZE_OF_INTEREST_MM


def reports_a_scan_in(streams: Streams) -> int:
    """``reports_a_scan``, to be cached."""
    return reports_a_scan(streams.touches)


def reports_a_scan(touches: Sequence[TouchTrace]) -> int:
    """Reports from scan to scan, those between them on straight lines; 1 where none are, or too few events show it."""
    squares = [_squared_bends(touch) for touch in touches]
    shown = [n for n in range(2, MOST_A_SCAN + 1) if _ratio(squares, n) > SMALLER]
    return max(shown, default=1)  # what shows every sixth shows every second, too


def _squared_bends(touch: TouchTrace) -> tuple[np.ndarray, FloatArray]:
    """Slots (k,) of reports with both neighbours, and their squared distance from the middle of these, mm²."""
    if touch.t_s.size < FEWEST:
        return np.empty(0, int), np.empty(0)
    xy_mm = np.column_stack([touch.x_mm, touch.y_mm])
    slot = events_of(touch.t_s, xy_mm).slot
    whole = (np.diff(slot)[:-1] == 1) & (np.diff(slot)[1:] == 1)
    bend_mm = xy_mm[1:-1] - 0.5 * (xy_mm[:-2] + xy_mm[2:])
    return slot[1:-1][whole], np.sum(bend_mm[whole] ** 2, axis=1)


def _ratio(squares: Sequence[tuple[np.ndarray, FloatArray]], n: int) -> float:
    """Median over runs of the largest mean square of a place between two scans over the second largest."""
    out = []
    for slot, square in squares:
        count = np.bincount(slot % n, minlength=n)
        if count.min() >= FEWEST:
            second, first = np.sort(np.bincount(slot % n, square, n) / count)[-2:]
            out.append(first / second if second > 0 else np.inf if first > 0 else 1.0)
    return float(np.median(out)) if out else 1.0


def _off_chord_mm(touch: TouchTrace, n: int) -> FloatArray:
    """Mean distance (m,) of n chords from a path that curves as the trace does."""
    xy_mm = np.column_stack([touch.x_mm, touch.y_mm])
    at_s = np.arange(touch.t_s[0] + CURVED_S, touch.t_s[-1] - CURVED_S, CURVED_S)
    fit = local_fit(touch.t_s, xy_mm, at_s, CURVED_S)
    scan_s = n * float(np.median(np.diff(touch.t_s)))
    return np.asarray(np.hypot(*fit.a_mm_s2[fit.ok].T) * scan_s**2 / 12)
