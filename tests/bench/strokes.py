"""Simulated strokes there and back across the beam."""

from __future__ import annotations

from itertools import cycle, islice

import numpy as np

from draglag.recording import Run
from draglag.simulation import Rig, RunTruth, simulate_run_with_truth
from draglag.simulation.kinematics import GRID_HZ, Motion

STROKES = 40
ALONG = 0.4  # of the panel's width, of all strokes together


def even_strokes(
    rig: Rig,
    speed_mm_s: float,
    way_mm: float,
    *,
    turn_s: float = 0.03,
    off_middle: float = 0.0,
    speeds: tuple[float, ...] = (1.0,),
    along: tuple[float, ...] = (0.0,),
    run_id: str = "stroke",
) -> tuple[Run, RunTruth]:
    """A free drag at an even speed but for ``turn_s`` at each end of its way.

    ``off_middle``: of the way. ``speeds``: of the pairs of strokes in turn, relative; ``along``: speeds along the
    beam of the single strokes in turn, as shares of that across it, on top of a slow one.
    """
    stroke_s = way_mm / speed_mm_s
    t_s = np.arange(0.0, STROKES * stroke_s, 1 / GRID_HZ)
    count = np.floor(t_s / stroke_s).astype(int)
    pairs = np.array(list(islice(cycle(speeds), STROKES)))
    sideways = np.array(list(islice(cycle(along), STROKES)))
    slow_mm_s = ALONG * rig.screen.width_mm / t_s[-1]
    turning = np.full(round(turn_s * GRID_HZ), 1 / round(turn_s * GRID_HZ))
    across_mm_s = np.convolve(np.where(count % 2, -1.0, 1.0) * speed_mm_s * pairs[count // 2], turning, "same")
    along_mm_s = np.convolve(slow_mm_s + speed_mm_s * sideways[count], turning, "same")
    x_mm = 0.3 * rig.screen.width_mm + np.cumsum(along_mm_s) / GRID_HZ
    vy_mm_s = across_mm_s + rig.beam.slope * along_mm_s
    y_mm = np.cumsum(across_mm_s) / GRID_HZ + (off_middle - 0.5) * way_mm + rig.beam.slope * x_mm
    motion = Motion(t_s, x_mm, y_mm + rig.beam.intercept_mm, along_mm_s, vy_mm_s, np.ones(t_s.size, bool))
    rng = np.random.default_rng([1, round(speed_mm_s)])
    return simulate_run_with_truth(rig, motion, run_id=run_id, planned=None, start_s=3.0, rng=rng)
