"""Stalls: the host delays events and delivers them at once."""

from __future__ import annotations

import numpy as np

from draglag.gap.constants import SIZE_OF_INTEREST_MM
from draglag.gap.streams.evidence import FEWEST
from draglag.recording import FloatArray, Session, TouchTrace

FOLLOWS = "frame"
HELD, AT_ONCE = 1.8, 0.25  # of the frames' interval: a pause of nearly two, and the next event at once. Derived
AVERAGED = 9  # events, of the narrowest window in which a position is fitted. Derived


def stalls(session: Session) -> bool:
    """Whether events that a host held back and delivered at once move positions by a size of interest, RMS."""
    moved = [_moved_mm2(run.touch) for run in session.runs if run.touch.t_s.size > FEWEST]
    return bool(moved) and float(np.sqrt(np.mean(np.concatenate(moved)))) > SIZE_OF_INTEREST_MM


def _moved_mm2(touch: TouchTrace) -> FloatArray:
    """Squares of the distances that events lie behind the stylus, means as of a position."""
    dt_s = np.diff(touch.t_s)
    frame_s = float(np.median(dt_s))
    paused = np.flatnonzero((dt_s[:-1] > HELD * frame_s) & (dt_s[1:] < AT_ONCE * frame_s))
    late_s = np.zeros(touch.t_s.size)
    for k in paused:
        # The first event is late by all that the pause exceeds a frame, each that follows at once by a frame less.
        each_s = np.arange(dt_s[k] - frame_s, 0, -frame_s)[: touch.t_s.size - k - 1]
        late_s[k + 1 : k + 1 + each_s.size] = each_s
    speed_mm_s = np.hypot(np.diff(touch.x_mm), np.diff(touch.y_mm)).sum() / (touch.t_s[-1] - touch.t_s[0])
    return np.asarray((speed_mm_s * np.convolve(late_s, np.full(AVERAGED, 1 / AVERAGED), "same")) ** 2)
