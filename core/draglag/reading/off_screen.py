"""Touches beyond the screen that a session states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.messages import Message, message
from draglag.recording import Run, Screen, TouchTrace

MARGIN = 0.05  # of the width or height: calibrations are less exact than panels
SHARE = 0.01  # of a run's events: single wild ones are no wrong unit


def off_screen(screen: Screen, runs: Sequence[Run]) -> list[Message]:
    """One sentence on the runs whose touches lie off the screen; empty without any."""
    far = [run for run in runs if _lies_off(screen, run.touch)]
    if not far:
        return []
    x_mm, y_mm = (np.concatenate(parts) for parts in zip(*(_places(run.touch) for run in far), strict=True))
    names = ", ".join(run.id for run in far[:4])
    listed = names if len(far) <= 4 else message("{shown} and {n} more", shown=names, n=len(far) - 4)
    return [
        message(
            "The touches of {runs} reach from {left:.4g} to {right:.4g} mm across and {top:.4g} to {bottom:.4g} mm "
            "down, on a screen that is stated to be {width:.4g} × {height:.4g} mm: a size or the positions are in a "
            "wrong unit, or the calibration is another screen's.",
            runs=listed,
            left=x_mm.min(),
            right=x_mm.max(),
            top=y_mm.min(),
            bottom=y_mm.max(),
            width=screen.width_mm,
            height=screen.height_mm,
        )
    ]


def _places(touch: TouchTrace) -> tuple[np.ndarray, np.ndarray]:
    there = np.isfinite(touch.x_mm) & np.isfinite(touch.y_mm)
    return touch.x_mm[there], touch.y_mm[there]


def _lies_off(screen: Screen, touch: TouchTrace) -> bool:
    x_mm, y_mm = _places(touch)
    if not x_mm.size or not (screen.width_mm > 0 and screen.height_mm > 0):
        return False
    with np.errstate(over="ignore"):
        off = np.maximum(np.abs(x_mm / screen.width_mm - 0.5), np.abs(y_mm / screen.height_mm - 0.5)) > 0.5 + MARGIN
    return float(off.mean()) > SHARE
