"""A latency law applied to recorded touch data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.path.events import contact_losses, in_contact, sample_interval_s, usable
from draglag.path.inversion import Law, StylusPath, stylus_path, stylus_speed, stylus_time_s
from draglag.path.local_fit import local_fit
from draglag.recording import FloatArray, IntArray, TouchTrace
from draglag.shown import brief, table_html

FEWEST_EVENTS = 8  # for a movement
STEEP_S = 0.03  # v · L′(v) from which simulated Screens 1 and 2 are better undone as a whole
SPREAD = "_min_median_max"  # ends the names of three numbers
PAUSE_S = 2.0  # what lies further apart is not one movement


def _fill_from_trace(
    moved_to: list[FloatArray], at_s: FloatArray, t_s: FloatArray, xy_mm: FloatArray, own_s: FloatArray
) -> None:
    """Fill NaN positions (m,) at times at_s from the trace when it shows them; NaN outside of contact."""
    forwards = np.append(np.diff(own_s) > 0, True)
    losses_s = contact_losses(t_s)
    shown_s = np.interp(at_s, own_s[forwards], t_s[forwards], left=np.nan, right=np.nan)
    placed = np.isfinite(shown_s) & in_contact(t_s, np.where(np.isfinite(shown_s), shown_s, -np.inf), losses_s)
    for values, shown in zip(moved_to, xy_mm.T, strict=True):
        values[:] = np.where(np.isfinite(values), values, np.interp(shown_s, t_s, shown))
        values[~placed] = np.nan


def _is_steep(law: Law, speed_mm_s: FloatArray) -> bool:
    """Whether events must be inverted together, as an error of speed moves them far."""
    speed = speed_mm_s[np.isfinite(speed_mm_s)]
    if not speed.size:
        return False
    slope = (law(1.02 * speed) - law(0.98 * speed)) / 0.04
    return float(np.percentile(np.abs(slope), 90)) > STEEP_S


def _falling_and_rise(law: Law) -> tuple[Law, Law]:
    """The largest law that never rises and lies nowhere above a law, and what the law has above it. Only of one that
    never rises are events undone together."""
    speed = np.geomspace(0.05, 1e4, 4096)
    lag_s = np.asarray(law(speed), float)
    least_s = np.minimum.accumulate(lag_s)
    if not np.any(least_s < lag_s):
        return law, lambda v: np.zeros(np.shape(v))
    return lambda v: np.interp(v, speed, least_s), lambda v: np.interp(v, speed, lag_s - least_s)


def _without_rise(t_s: FloatArray, speed_mm_s: FloatArray, rise: Law) -> FloatArray:
    """Times of events (n,) of a law's falling part alone, non-decreasing."""
    known = np.isfinite(speed_mm_s)
    return np.maximum.accumulate(t_s - np.interp(t_s, t_s[known], rise(speed_mm_s[known])))


@dataclass(frozen=True)
class Compensated:
    """Recorded touch events with the lag taken out, (n,), NaN where unknown.

    Attributes:
        stylus_t_s: when the stylus was where the event shows it.
        latency_s: t_s − stylus_t_s.
        x_stylus_mm, y_stylus_mm: where the stylus was at t_s; NaN for the last events of a contact, about one latency:
            what would show it was never recorded.
        moved_mm: from the recorded place to that.
        notes: what was corrected or left, and what looks wrong, in words.
    """

    t_s: FloatArray
    stylus_t_s: FloatArray
    latency_s: FloatArray
    speed_mm_s: FloatArray
    x_stylus_mm: FloatArray
    y_stylus_mm: FloatArray
    extrapolated: np.ndarray
    moved_mm: FloatArray
    notes: tuple[str, ...] = ()

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
            f"latency_ms{SPREAD}": spread(latency_ms),
            f"moved_mm{SPREAD}": spread(moved),
            "moved_rms_mm": float(np.sqrt(np.mean(moved**2))) if moved.size else None,
        }

    __repr__ = brief

    def _repr_html_(self) -> str:
        report = self.report()
        spreads = [(key.removesuffix(SPREAD), *value) for key, value in report.items() if isinstance(value, list)]
        numbers = [(key, value) for key, value in report.items() if not isinstance(value, list)]
        notes = table_html("Notes", [""], [(note,) for note in self.notes]) if self.notes else ""
        return (
            table_html("Compensated touch events", ["", "number"], numbers)
            + table_html("Of the events", ["", "smallest", "median", "largest"], spreads)
            + notes
        )


def merged(t_s: FloatArray, parts: Sequence[tuple[np.ndarray, Compensated]]) -> Compensated:
    """Of all events (n,), from parts of them: (which of the events, what they became); NaN for events of no part."""
    columns = [spec.name for spec in fields(Compensated) if spec.name != "notes"]
    out: dict[str, Any] = {name: np.full(t_s.shape, np.nan) for name in columns}
    out |= {"t_s": t_s.copy(), "extrapolated": np.zeros(t_s.shape, bool)}
    for which, part in parts:
        for name, values in out.items():
            values[which] = getattr(part, name)
    return Compensated(**out)


def compensate(
    t_s: FloatArray,
    x_mm: FloatArray,
    y_mm: FloatArray,
    law: Law,
    speed_range_mm_s: tuple[float, float] = (0.0, np.inf),
    recorded: tuple[FloatArray, FloatArray, FloatArray] | None = None,
) -> Compensated:
    """Where the stylus was, given touch events (n,) of one contact, in any order.

    recorded: times and positions as recorded, where t_s, x_mm and y_mm are corrected for effects: the place of the
    stylus is sought at these times, latencies and distances are counted from them.

    Raises DataError with fewer than eight usable events or arrays of different length.
    """
    t_s, x_mm, y_mm = (np.asarray(v, float) for v in (t_s, x_mm, y_mm))
    if not t_s.shape == x_mm.shape == y_mm.shape or t_s.ndim != 1:
        raise DataError("times and positions differ in number", "Give one t, x and y for each event")
    touch = usable(TouchTrace(t_s, x_mm, y_mm))
    if touch.t_s.size < FEWEST_EVENTS:
        raise DataError(
            message("{n} usable touch events are too few", n=touch.t_s.size), "Give at least eight with finite t, x, y"
        )
    own_s, speed, paths = _undone(touch, law)
    at_s, x_shown_mm, y_shown_mm = (t_s, x_mm, y_mm) if recorded is None else recorded
    good = np.isfinite(t_s) & np.isfinite(x_mm) & np.isfinite(y_mm)
    index = np.clip(np.searchsorted(touch.t_s, t_s), 0, touch.t_s.size - 1)
    of_event = good & (touch.t_s[index] == t_s)  # strays are events of no stylus
    x_own, y_own = moved_to = [np.full(t_s.shape, np.nan) for _ in range(2)]
    for one, path in paths:
        rows = good & (index >= one[0]) & (index <= one[-1])
        for values, column in zip(moved_to, path.xy_mm.T, strict=True):
            values[rows] = np.interp(at_s[rows], path.t_s, column)
    at_good_s = np.where(good, at_s, np.nan)
    _fill_from_trace(moved_to, at_good_s, touch.t_s, np.column_stack([touch.x_mm, touch.y_mm]), own_s)
    stylus_s, v = (np.where(of_event, values[index], np.nan) for values in (own_s, speed))
    return Compensated(
        at_s,
        stylus_s,
        at_s - stylus_s,
        v,
        x_own,
        y_own,
        (v < speed_range_mm_s[0]) | (v > speed_range_mm_s[1]),
        np.hypot(x_own - x_shown_mm, y_own - y_shown_mm),
    )


def _undone(touch: TouchTrace, law: Law) -> tuple[FloatArray, FloatArray, list[tuple[IntArray, StylusPath]]]:
    """When the stylus was where each event shows it, its speed then, (n,) each; paths of events undone as a whole."""
    xy_mm = np.column_stack([touch.x_mm, touch.y_mm])
    half_s = max(0.05, 4.5 * sample_interval_s(touch.t_s))
    own_s = stylus_time_s(touch.t_s, xy_mm, touch.t_s, law, half_s)
    if not np.isfinite(own_s).all():
        raise DataError("no stretch of the events is long enough for a speed", "Give an uninterrupted recording")
    fit = local_fit(touch.t_s, xy_mm, touch.t_s, half_s)
    speed = np.where(fit.ok, stylus_speed(law, fit.v_mm_s, fit.a_mm_s2), np.nan)
    paths = []
    falling, rise = _falling_and_rise(law)
    for one in np.split(np.arange(touch.t_s.size), np.flatnonzero(np.diff(touch.t_s) > PAUSE_S) + 1):
        if one.size >= FEWEST_EVENTS and _is_steep(law, speed[one]):
            path = stylus_path(_without_rise(touch.t_s[one], speed[one], rise), xy_mm[one], falling)
            own_s[one] = path.event_t_s
            speed[one] = np.where(fit.ok[one], np.interp(path.event_t_s, path.t_s, path.speed_mm_s), np.nan)
            paths.append((one, path))
    return np.maximum.accumulate(own_s), speed, paths
