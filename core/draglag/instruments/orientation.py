"""Whether touches are mirrored, as by a touchscreen turned after calibration."""

from __future__ import annotations

from typing import Literal

import numpy as np

from draglag.messages import message
from draglag.protocol.targets import Target
from draglag.recording import FloatArray, Screen, TouchTrace

Orientation = Literal["turned", "left_right", "top_bottom"]

WORDS: dict[Orientation, str] = {
    "turned": message("turned by half a turn"),
    "left_right": message("mirrored left to right"),
    "top_bottom": message("mirrored top to bottom"),
}
FEWEST_TOUCHES = 30
# A hand on the target stays within this of it, a panel's lag allowed for; a trace off by less is no matter of mirrors.
_NEAR_MM = 25.0
_OFF_MM = 50.0
# By how much touches may trail the target: hand and panel together.
_LAGS_S = np.linspace(0.0, 0.4, 21)


def wrong_way_round(touch: TouchTrace, target: Target, start_s: float, screen: Screen) -> Orientation | None:
    """How a run's touches are mirrored against its target, which moves from ``start_s``; None if not, or undecided."""
    t_s = touch.t_s - start_s
    usable = (t_s >= 0) & np.isfinite(touch.x_mm) & np.isfinite(touch.y_mm)
    if np.count_nonzero(usable) < FEWEST_TOUCHES:
        return None
    t_s, x, y = t_s[usable], touch.x_mm[usable], touch.y_mm[usable]
    if _distance_mm(t_s, x, y, target) < _OFF_MM:
        return None
    other_x, other_y = screen.width_mm - x, screen.height_mm - y
    images: tuple[tuple[Orientation, FloatArray, FloatArray], ...] = (
        ("turned", other_x, other_y),
        ("left_right", other_x, y),
        ("top_bottom", x, other_y),
    )
    distance_mm: dict[Orientation, float] = {name: _distance_mm(t_s, a, b, target) for name, a, b in images}
    best = min(distance_mm, key=lambda name: distance_mm[name])
    return best if distance_mm[best] < _NEAR_MM else None


def _distance_mm(t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray, target: Target) -> float:
    distance_mm = []
    for lag_s in _LAGS_S:
        there_x, there_y = target.position_mm(np.clip(t_s - lag_s, 0.0, target.duration_s))
        distance_mm.append(float(np.median(np.hypot(x_mm - there_x, y_mm - there_y))))
    return float(np.nanmin(distance_mm)) if np.isfinite(distance_mm).any() else 0.0
