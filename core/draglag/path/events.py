"""Usable touch events, and losses of contact."""

from __future__ import annotations

import numpy as np

from draglag.recording import FloatArray, TouchTrace

# Events that come a few at a time: a quarter or more of the intervals is negligible compared with the long ones.
AT_ONCE, LONG, BATCHED, FEWEST_INTERVALS = 0.25, 0.9, 0.25, 8


# No hand goes there and back within two events at 10 m/s, or by less than noise; contacts in turn are no strays.
STRAY_MM_S, STRAY_MM, MOST_STRAYS = 1e4, 5.0, 0.02

# No hand turns a stylus round faster, mm/s²: shaken at 8 Hz over 10 cm, it reaches 1.3e5. Of one contact at most three
# events come before those of the next. Simulated screens with the largest effects have 16 such events of 40 at most,
# two to five contacts at a time 27 or more.
FASTEST_TURN_MM_S2, MOST_BY_TURNS, IN_A_ROW, MIXED = 2e5, 3, 40, 0.5


def usable(touch: TouchTrace) -> TouchTrace:
    """Finite events in order of time, the last of each stamp, without strays: digitisers repeat stamps, may step back,
    and report zeros."""
    return without_strays(touch)[0]


def without_strays(touch: TouchTrace) -> tuple[TouchTrace, int]:
    """``usable`` events, and how many strays were left out."""
    touch = in_order(touch)
    off = strays(touch)
    if not off.any():
        return touch, 0
    ids = touch.contact_id[~off] if touch.contact_id.size == off.size else touch.contact_id
    kept = TouchTrace(touch.t_s[~off], touch.x_mm[~off], touch.y_mm[~off], ids, gaps_s=touch.gaps_s)
    return kept, int(np.count_nonzero(off))


def strays(touch: TouchTrace) -> np.ndarray:
    """Which events (n,) in order of time lie far from both neighbours, which lie near each other."""
    out = np.zeros(touch.t_s.size, bool)
    if out.size < 3:
        return out
    way_mm, apart_s = np.hypot(np.diff(touch.x_mm), np.diff(touch.y_mm)), np.diff(touch.t_s)
    far = way_mm > np.maximum(STRAY_MM_S * apart_s, STRAY_MM)
    out[1:-1] = far[:-1] & far[1:]
    if out.any():
        over_mm = np.hypot(touch.x_mm[2:] - touch.x_mm[:-2], touch.y_mm[2:] - touch.y_mm[:-2])
        out[1:-1] &= over_mm < 0.5 * np.minimum(way_mm[:-1], way_mm[1:])
    return out if np.mean(out) <= MOST_STRAYS else np.zeros(out.size, bool)


def events_of_several(touch: TouchTrace) -> int:
    """How many finite events no stylus could pass on its way from those before to those after; 0 unless they are half
    of some 40 in a row, as where several contacts are mixed: single ones come of lags that change quickly."""
    keep = np.isfinite(touch.t_s) & np.isfinite(touch.x_mm) & np.isfinite(touch.y_mm)
    order = np.flatnonzero(keep)[np.argsort(touch.t_s[keep], kind="stable")]
    events = TouchTrace(touch.t_s[order], touch.x_mm[order], touch.y_mm[order])
    apart = ~strays(events)
    turns = _impossible_turns(events.t_s[apart], np.column_stack([events.x_mm, events.y_mm])[apart])
    counted = np.append(0, np.cumsum(turns))
    most = np.max(counted[IN_A_ROW:] - counted[:-IN_A_ROW], initial=0) if counted.size > IN_A_ROW else 0
    return int(counted[-1]) if most >= MIXED * IN_A_ROW else 0


def _impossible_turns(t_s: FloatArray, xy_mm: FloatArray) -> np.ndarray:
    """Which events (n,), in order of time, lie where no hand turns so fast."""
    out = np.zeros(t_s.size, bool)
    dt_s = np.diff(t_s)
    usual_s = sample_interval_s(t_s) if dt_s.any() else 0.0
    mean_s = float(np.mean(dt_s[dt_s <= 3.5 * usual_s])) if usual_s else 0.0  # within batches too
    for k in range(1, min(MOST_BY_TURNS, (t_s.size - 1) // 2) + 1):
        bend_mm = np.hypot(*(xy_mm[2 * k :] - 2 * xy_mm[k:-k] + xy_mm[: -2 * k]).T)
        half_s = np.maximum(0.5 * (t_s[2 * k :] - t_s[: -2 * k]), k * mean_s)
        out[k:-k] |= bend_mm > np.maximum(FASTEST_TURN_MM_S2 * half_s**2, 2 * STRAY_MM)
    return out


def in_order(touch: TouchTrace) -> TouchTrace:
    """Finite events in order of time, the last of each stamp."""
    keep = np.isfinite(touch.t_s) & np.isfinite(touch.x_mm) & np.isfinite(touch.y_mm)
    order = np.flatnonzero(keep)[np.argsort(touch.t_s[keep], kind="stable")]
    if order.size:
        t_s = touch.t_s[order]
        order = order[np.append(np.diff(t_s) > 0, True)]
    ids = touch.contact_id[order] if touch.contact_id.size == touch.t_s.size else touch.contact_id
    return TouchTrace(touch.t_s[order], touch.x_mm[order], touch.y_mm[order], ids, gaps_s=touch.gaps_s)


def median(values: FloatArray) -> float:
    """``np.median`` of (n,) finite values, n > 0, without its overhead."""
    half = values.size // 2
    if values.size % 2:
        return float(np.partition(values, half)[half])
    pair = np.partition(values, (half - 1, half))[half - 1 : half + 1]
    return float(0.5 * (pair[0] + pair[1]))


def last_of_batches(touch: TouchTrace) -> TouchTrace:
    """The last event of each batch, the only one with its own stamp."""
    together = _together(np.diff(touch.t_s))
    if not together.any():
        return touch
    keep = np.append(~together, True)
    ids = touch.contact_id[keep] if touch.contact_id.size == keep.size else touch.contact_id
    return TouchTrace(touch.t_s[keep], touch.x_mm[keep], touch.y_mm[keep], ids, gaps_s=touch.gaps_s)


def _together(dt_s: FloatArray) -> np.ndarray:
    if dt_s.size < FEWEST_INTERVALS:
        return np.zeros(dt_s.size, bool)
    together = dt_s < AT_ONCE * np.partition(dt_s, int(LONG * dt_s.size))[int(LONG * dt_s.size)]
    return np.asarray(together if together.mean() > BATCHED else np.zeros(dt_s.size, bool))


def sample_interval_s(t_s: FloatArray) -> float:
    """Median interval between events or batches; NaN with fewer than two."""
    if t_s.size < 2:
        return float("nan")
    dt_s = np.diff(t_s)
    return median(dt_s[~_together(dt_s)])


def contact_losses(t_s: FloatArray, factor: float = 3.5) -> FloatArray:
    """Stretches without events longer than ``factor`` sample intervals, (k, 2) s."""
    dt_s = np.diff(t_s)
    where = np.flatnonzero(dt_s > factor * sample_interval_s(t_s)) if dt_s.size else np.empty(0, int)
    return np.column_stack([t_s[where], t_s[where + 1]]) if where.size else np.empty((0, 2))


def in_contact(t_s: FloatArray, at_s: FloatArray, losses_s: FloatArray) -> np.ndarray:
    """Whether times (m,) lie inside the trace and outside contact losses."""
    if t_s.size == 0:
        return np.zeros(at_s.shape, bool)
    inside: np.ndarray = (at_s >= t_s[0]) & (at_s <= t_s[-1])
    if losses_s.size:
        k = np.searchsorted(losses_s[:, 0], at_s, side="right") - 1
        inside &= ~((k >= 0) & (at_s < losses_s[np.maximum(k, 0), 1]))
    return inside


def hold_at_rate(touch: TouchTrace, rate_hz: float) -> TouchTrace:
    """The last event at each tick of a loop (the paper, Section II.A).

    Adds about half a tick plus half a touch interval of latency.
    """
    if touch.t_s.size == 0:
        return touch
    ticks_s = np.arange(np.ceil(touch.t_s[0] * rate_hz), np.floor(touch.t_s[-1] * rate_hz) + 1) / rate_hz
    last = np.searchsorted(touch.t_s, ticks_s, side="right") - 1
    return TouchTrace(ticks_s, touch.x_mm[last], touch.y_mm[last], gaps_s=touch.gaps_s)


def first_of_contact(t_s: FloatArray) -> np.ndarray:
    """Which events (n,) follow a loss of contact, or begin the trace."""
    out = np.zeros(t_s.size, bool)
    out[:1] = True
    out[np.searchsorted(t_s, contact_losses(t_s)[:, 1])] = True
    return out
