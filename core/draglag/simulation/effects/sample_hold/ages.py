"""Scatter of the positions' age."""

from __future__ import annotations

import numpy as np

from draglag.gap.streams.stamps import FAST_MM_S
from draglag.recording import TouchTrace

UNEVEN_AGE = 0.03  # of the interval between stamps
FEWEST = 200  # steps of a run that shows the scatter of its ages
REMAINING = 0.7  # of the unevenness; where the ages were found, 0.1 to 0.5 of it stay


def ages_remain(recorded: list[TouchTrace], even: list[TouchTrace], period_s: float) -> bool:
    """Whether undoing left ages uneven."""
    before_s = uneven_age_s(recorded)
    return before_s > UNEVEN_AGE * period_s and uneven_age_s(even) > REMAINING * before_s


def uneven_age_s(touches: list[TouchTrace], step_mm: float = 0.0) -> float:
    """Standard deviation of the positions' age, median over the faster half of fast runs; 0 without any.

    Age moves positions along the path only: excess scatter of third differences there. A deadband's ages vanish with
    speed.
    """
    ages: list[tuple[float, float]] = []
    for touch in touches:
        t_s, xy_mm = touch.t_s, np.column_stack([touch.x_mm, touch.y_mm])
        frame_s = float(np.median(np.diff(t_s)))
        third = xy_mm[3:] - 3 * xy_mm[2:-1] + 3 * xy_mm[1:-2] - xy_mm[:-3]
        chord, span_s = xy_mm[3:] - xy_mm[:-3], t_s[3:] - t_s[:-3]
        length = np.hypot(chord[:, 0], chord[:, 1])
        whole = (np.abs(span_s - 3 * frame_s) < 0.3 * frame_s) & (length > 0)
        even = np.abs(np.diff(t_s) - frame_s) < 0.3 * frame_s  # none where frames come in batches
        if min(np.count_nonzero(whole), np.count_nonzero(even)) < FEWEST:
            continue
        speed = float(np.median(length[whole] / span_s[whole]))
        if speed < FAST_MM_S:
            continue
        ahead = chord[whole] / length[whole, None]
        along = np.sum(third[whole] * ahead, axis=1)
        across = third[whole, 0] * ahead[:, 1] - third[whole, 1] * ahead[:, 0]
        # Where the motion turns, a latency that depends on direction jumps by itself.
        straight = np.abs(ahead[:, 1]) > 0.4
        along, across = along[straight], across[straight]
        # 1 + 9 + 9 + 1: what third differences make of the variance of single events.
        variance_s2 = (_robust_variance(along) - _robust_variance(across)) / 20 / speed**2
        variance_s2 -= step_mm**2 / 12 / speed**2  # the coordinate that hardly changes is rounded alike
        stamps_s2 = 0.5 * _robust_variance(np.diff(t_s)[even])
        ages.append((speed, float(np.sqrt(max(variance_s2 - stamps_s2, 0.0)))))
    faster = sorted(ages)[len(ages) // 2 :]
    return float(np.median([age_s for _, age_s in faster])) if faster else 0.0


def _robust_variance(values: np.ndarray) -> float:
    """Mean square about the median, without outliers."""
    off = values - np.median(values)
    far = 6 * 1.4826 * float(np.median(np.abs(off)))
    return float(np.mean(np.clip(off, -far, far) ** 2))
