"""Stalls: events that a host delays and delivers at once, or positions that stand still and leap."""

from __future__ import annotations

import numpy as np

from draglag.gap.constants import SIZE_OF_INTEREST_MM
from draglag.gap.streams.evidence import FEWEST
from draglag.gap.streams.lattice import basis_of, lengths_mm
from draglag.gap.streams.stamps import OF_STEPS, TURNING, repeats, stood
from draglag.latency.steady import has_constant_speed
from draglag.recording import FloatArray, Session, TouchTrace

FOLLOWS = "frame"
HELD, AT_ONCE = 1.8, 0.25  # of the usual interval: a pause of nearly two, and the next event at once. Derived
MADE_UP = 0.5  # of the next step's speed, that a leap has over all the time that positions stood still. Derived
AVERAGED = 9  # events, of the narrowest window in which a position is fitted. Derived


def stalls(session: Session) -> bool:
    """Whether what a host or a panel held back moves positions of steady runs by a size of interest, RMS."""
    steady = [run.touch for run in session.runs if has_constant_speed(run)]
    touches = [touch for touch in steady if touch.t_s.size > FEWEST]
    basis = basis_of(touches) if touches else None
    step_mm = 0.0 if basis is None else max(lengths_mm(basis))
    moved = [_delayed_mm(touch) + _stood_mm(touch, step_mm) for touch in touches]
    return bool(moved) and float(np.sqrt(np.mean(np.concatenate(moved) ** 2))) > SIZE_OF_INTEREST_MM


def _delayed_mm(touch: TouchTrace) -> FloatArray:
    """How far events lie behind the stylus for they were delivered late, (n,), means as of a position."""
    dt_s = np.diff(touch.t_s)
    frame_s = float(np.median(dt_s))
    paused = np.flatnonzero((dt_s[:-1] > HELD * frame_s) & (dt_s[1:] < AT_ONCE * frame_s))
    late_s = np.zeros(touch.t_s.size)
    for k in paused:
        # The first event is late by all that the pause exceeds a frame, each that follows at once by a frame less.
        each_s = np.arange(dt_s[k] - frame_s, 0, -frame_s)[: touch.t_s.size - k - 1]
        late_s[k + 1 : k + 1 + each_s.size] = each_s
    speed_mm_s = np.hypot(np.diff(touch.x_mm), np.diff(touch.y_mm)).sum() / (touch.t_s[-1] - touch.t_s[0])
    return _as_fitted(speed_mm_s * late_s)


def _stood_mm(touch: TouchTrace, step_mm: float) -> FloatArray:
    """How far events lie behind the stylus for they repeat a position unusually long, (n,), means as of a position."""
    fresh, out = np.flatnonzero(np.append(True, ~repeats(touch))), np.zeros(touch.t_s.size)
    events, begin, behind_mm = stood(touch)
    if not events.size:
        return out
    after_s = np.diff(touch.t_s[fresh])
    leap_mm = np.hypot(np.diff(touch.x_mm[fresh]), np.diff(touch.y_mm[fresh]))
    speed_mm_s = leap_mm / np.maximum(after_s, 1e-9)
    # Out of a rest the first step is a usual one; what stood still while the stylus moved makes up for all that time.
    held = speed_mm_s > MADE_UP * np.append(speed_mm_s[1:], np.inf)
    held &= after_s > HELD * np.median(after_s)
    held &= leap_mm > OF_STEPS * step_mm
    if touch.contact_id.size == touch.t_s.size:
        held &= np.diff(touch.contact_id[fresh]) == 0  # another contact lies elsewhere
    held &= _moving(touch)[fresh[:-1]]
    out[events] = np.where(held[np.searchsorted(fresh, begin)], behind_mm, 0.0)
    return _as_fitted(out)


def _moving(touch: TouchTrace) -> np.ndarray:
    """Whether positions came to each event (n,) at about their usual speed, and not as strokes to their turn."""
    before = np.maximum(np.arange(touch.t_s.size) - AVERAGED, 0)
    way_mm = np.hypot(touch.x_mm - touch.x_mm[before], touch.y_mm - touch.y_mm[before])
    speed_mm_s = way_mm / np.maximum(touch.t_s - touch.t_s[before], 1e-9)
    return np.asarray(speed_mm_s > TURNING * float(np.median(speed_mm_s)))


def _as_fitted(values: FloatArray) -> FloatArray:
    return np.convolve(values, np.full(AVERAGED, 1 / AVERAGED), "same")
