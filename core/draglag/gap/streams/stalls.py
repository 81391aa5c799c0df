"""Stalls: the host delays events and delivers them at once."""

from __future__ import annotations

import numpy as np

from draglag.recording import Session

FOLLOWS = "frame"
FEWEST, PER_S = 10, 0.05  # bursts, and bursts a second: one here and there is any host's. Judgement
HELD, AT_ONCE = 1.8, 0.25  # of the frames' interval: a pause of nearly two, and the next event at once. Derived
HELD_S = 0.003  # beyond a frame; less is the jitter of a busy host, whatever the frames' rate. Physical


def stalls(session: Session) -> bool:
    """Whether bursts after pauses are more frequent than on sound hosts."""
    bursts, total_s = 0, 0.0
    for run in session.runs:
        dt_s = np.diff(run.touch.t_s)
        if dt_s.size < 50:
            continue
        frame_s = float(np.median(dt_s))
        paused = dt_s[:-1] > max(HELD * frame_s, frame_s + HELD_S)
        bursts += int(np.count_nonzero(paused & (dt_s[1:] < AT_ONCE * frame_s)))
        total_s += float(run.touch.t_s[-1] - run.touch.t_s[0])
    return bursts >= FEWEST and bursts >= PER_S * total_s
