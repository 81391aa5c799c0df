"""The public timer's estimate of a drag latency, in lean numpy: the efficient estimator's competitor in speed.

For each side of the beam, found by counting edges, it minimises the residual of a line through touch positions
interpolated at laser time + S: 0 to 200 ms in steps of 1 ms, then ±3 ms in steps of 0.02 ms, and averages the two
minima. The line is fitted in closed form, on positions about their means.
"""

from __future__ import annotations

import numpy as np

from draglag.recording import Run


def _residual(t_s: np.ndarray, x_mm: np.ndarray, y_mm: np.ndarray, at_s: np.ndarray) -> float:
    x, y = np.interp(at_s, t_s, x_mm), np.interp(at_s, t_s, y_mm)
    n = at_s.size
    sx, sy = x.sum(), y.sum()
    xx, xy, yy = x @ x - sx * sx / n, x @ y - sx * sy / n, y @ y - sy * sy / n
    return float(yy - xy * xy / xx)


def walt_style_latency_s(run: Run) -> float:
    number = np.arange(run.laser.t_s.size)
    side = ((number + 1) // 2) % 2
    t_s = run.touch.t_s
    x_mm, y_mm = run.touch.x_mm - run.touch.x_mm.mean(), run.touch.y_mm - run.touch.y_mm.mean()
    best = []
    for which in (0, 1):
        edges_s = run.laser.t_s[side == which]
        coarse = np.arange(0.0, 0.2, 1e-3)
        around = coarse[int(np.argmin([_residual(t_s, x_mm, y_mm, edges_s + s) for s in coarse]))]
        fine = np.arange(around - 3e-3, around + 3e-3, 2e-5)
        best.append(fine[int(np.argmin([_residual(t_s, x_mm, y_mm, edges_s + s) for s in fine]))])
    return float(np.mean(best))
