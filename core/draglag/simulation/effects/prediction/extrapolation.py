"""Extrapolation by the velocity over the last events."""

from __future__ import annotations

import numpy as np

from draglag.recording import FloatArray


def window_start(t_s: FloatArray, window_s: float) -> tuple[np.ndarray, FloatArray, FloatArray]:
    """Place of the path a window ago: event before it, share of the way to the next, span in s; (n,)."""
    at_s = np.maximum(t_s - window_s, t_s[0])
    begin = np.clip(np.searchsorted(t_s, at_s, side="right") - 1, 0, max(t_s.size - 2, 0))
    after = np.minimum(begin + 1, t_s.size - 1)
    share = np.clip((at_s - t_s[begin]) / np.maximum(t_s[after] - t_s[begin], 1e-9), 0.0, 1.0)
    return begin, share, np.maximum(t_s - at_s, 1e-3)


def extrapolated(t_s: FloatArray, xy_mm: FloatArray, horizon_s: float, window_s: float) -> FloatArray:
    """Extrapolated positions (n, 2) of one contact."""
    if t_s.size < 2:
        return xy_mm
    begin, share, span_s = window_start(t_s, window_s)
    back = xy_mm[begin] + share[:, None] * (xy_mm[begin + 1] - xy_mm[begin])
    return np.asarray(xy_mm + horizon_s * (xy_mm - back) / span_s[:, None])
