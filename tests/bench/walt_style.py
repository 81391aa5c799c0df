"""The public timer's way to a drag latency, in plain numpy: the peer the efficient estimator is timed against.

For each side of the beam, chosen by counting edges, it minimises the residual of a straight line through touch
positions interpolated at laser time + S: 0 to 200 ms in steps of 1 ms, then ±3 ms in steps of 0.02 ms. The two sides'
minima are averaged.
"""

from __future__ import annotations

import numpy as np

from draglag.recording import Run


def _residual(run: Run, edges_s: np.ndarray, shift_s: float) -> float:
    x = np.interp(edges_s + shift_s, run.touch.t_s, run.touch.x_mm)
    y = np.interp(edges_s + shift_s, run.touch.t_s, run.touch.y_mm)
    slope, intercept = np.polyfit(x, y, 1)
    return float(np.sum((y - slope * x - intercept) ** 2))


def walt_style_latency_s(run: Run) -> float:
    number = np.arange(run.laser.t_s.size)
    side = ((number + 1) // 2) % 2
    best = []
    for which in (0, 1):
        edges_s = run.laser.t_s[side == which]
        coarse = np.arange(0.0, 0.2, 1e-3)
        around = coarse[int(np.argmin([_residual(run, edges_s, s) for s in coarse]))]
        fine = np.arange(around - 3e-3, around + 3e-3, 2e-5)
        best.append(fine[int(np.argmin([_residual(run, edges_s, s) for s in fine]))])
    return float(np.mean(best))
