"""Scatter of the positions' age."""

from __future__ import annotations

import numpy as np

from draglag.gap.streams.stamps import FAST_MM_S, TURNING
from draglag.recording import TouchTrace

UNEVEN_AGE = 0.03  # of the interval between stamps
FEWEST = 200  # steps of a run that shows the scatter of its ages
CERTAIN = 4.0  # standard errors by which noise of single events, however large, leaves ages even. Derived: one in 3e4
# Of the mean square of n third differences of white noise, in its square: 2 (1 + 2 (15² + 6² + 1²) / 20²). Derived
SHAKY = 4.62
REMAINING = 0.7  # of the unevenness; where the ages were found, 0.1 to 0.5 of it stay


def ages_remain(recorded: list[TouchTrace], even: list[TouchTrace], period_s: float) -> bool:
    """Whether undoing left ages uneven."""
    before_s = uneven_age_s(recorded)
    return before_s > UNEVEN_AGE * period_s and uneven_age_s(even) > REMAINING * before_s


def uneven_age_s(touches: list[TouchTrace], step_mm: float = 0.0) -> float:
    """Standard deviation of the positions' age, median over the faster half of fast runs; 0 if noise may be all of it.

    Age moves positions along the path only: excess scatter of third differences there. A deadband's ages vanish with
    speed.
    """
    ages: list[tuple[float, float, float]] = []
    for touch in touches:
        t_s, xy_mm = touch.t_s, np.column_stack([touch.x_mm, touch.y_mm])
        frame_s = float(np.median(np.diff(t_s)))
        third = (xy_mm[3:] - 3 * xy_mm[2:-1] + 3 * xy_mm[1:-2] - xy_mm[:-3])[4:-4]
        # The direction is that of the events on either side: noise of these themselves would lie along it.
        before, after, span_s = xy_mm[3:-8] - xy_mm[:-11], xy_mm[11:] - xy_mm[8:-3], t_s[7:-4] - t_s[4:-7]
        apart_mm = np.minimum(np.hypot(*before.T), np.hypot(*after.T))
        steady = apart_mm > max(TURNING * float(np.median(apart_mm)), 1e-9)
        whole = (np.abs(span_s - 3 * frame_s) < 0.3 * frame_s) & steady
        even = np.abs(np.diff(t_s) - frame_s) < 0.3 * frame_s  # none where frames come in batches
        if min(np.count_nonzero(whole), np.count_nonzero(even)) < FEWEST:
            continue
        chord = (before + after)[whole]
        length = np.hypot(*chord.T)
        speed = float(np.median(length)) / (6 * frame_s)
        if speed < FAST_MM_S:
            continue
        ahead = chord / np.maximum(length, 1e-9)[:, None]
        along = np.sum(third[whole] * ahead, axis=1)
        across = third[whole, 0] * ahead[:, 1] - third[whole, 1] * ahead[:, 0]
        # Where the motion turns, a latency that depends on direction jumps by itself.
        straight = np.abs(ahead[:, 1]) > 0.4
        along, across = along[straight], across[straight]
        if along.size < FEWEST:
            continue
        # 1 + 9 + 9 + 1: what third differences make of the variance of single events.
        both = np.array([_robust_variance(along), _robust_variance(across)]) / 20 / speed**2
        se_s2 = float(np.sqrt(SHAKY / along.size) * np.linalg.norm(both))
        variance_s2 = float(both[0] - both[1])
        variance_s2 -= step_mm**2 / 12 / speed**2  # the coordinate that hardly changes is rounded alike
        stamps_s2 = 0.5 * _robust_variance(np.diff(t_s)[even])
        ages.append((speed, variance_s2 - stamps_s2, se_s2))
    if not ages:
        return 0.0
    _, each_s2, se_s2 = np.array(sorted(ages)[len(ages) // 2 :]).T
    weight = 1 / np.maximum(se_s2, 1e-30) ** 2
    if weight @ each_s2 < CERTAIN * np.sqrt(weight.sum()):
        return 0.0
    return float(np.sqrt(max(np.median(each_s2), 0.0)))


def _robust_variance(values: np.ndarray) -> float:
    """Mean square about the median, without outliers."""
    off = values - np.median(values)
    far = 6 * 1.4826 * float(np.median(np.abs(off)))
    return float(np.mean(np.clip(off, -far, far) ** 2))
