"""Eq. 1–2 as published, on raw events."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.instruments.beam import fit_lines, sides, stylus_diameter_mm
from draglag.latency.common import alignment_at, common_flags, cost_without_shift
from draglag.latency.estimate import FEWEST_EDGES, Prepared, RunEstimate
from draglag.latency.scan import scan
from draglag.path.events import contact_losses, in_contact
from draglag.path.motion import SAVGOL_WINDOW, savitzky_golay
from draglag.recording import FloatArray

STEPS_S = (1e-3, 1e-4, 1e-5)  # the search is narrowed to 10 µs, far below any interval


def estimate_paper(ready: Prepared, blank: RunEstimate, window_s: tuple[float, float]) -> RunEstimate:
    """The latency that minimises Eq. 2; interval from the curvature of J."""
    first = scan(ready.touch, ready.edges, window_s, ready.stylus_diameter_mm, half_width_s=5 * ready.dt_s)
    low = first.minima()
    if not low:
        return replace(blank, flags=("unidentifiable",))
    latency_s, reach_s = float(first.latency_s[low[0]]), 0.006
    for step_s in STEPS_S:
        grid_s = np.arange(latency_s - reach_s, latency_s + reach_s, step_s)
        costs = [_cost(ready, value)[0] for value in grid_s]
        latency_s, reach_s = float(grid_s[int(np.argmin(costs))]), 3 * step_s
    cost, keep = _cost(ready, latency_s)
    if not np.isfinite(cost):
        return replace(blank, flags=("unidentifiable",))
    edges = ready.edges.take(keep)
    n = edges.t_s.size
    # Eq. 2 is a least-squares problem in L and four line coefficients: variance = 2 s² / J''.
    h = 2e-3
    curvature = (_cost(ready, latency_s + h)[0] - 2 * cost + _cost(ready, latency_s - h)[0]) / h**2
    se_s = float(np.sqrt(2 * cost / max(n - 5, 1) / curvature)) if curvature > 0 and n > 5 else float("nan")
    speed = _speed_at(ready, edges.t_s + latency_s)
    alignment = alignment_at(ready, edges, np.full(n, latency_s), shared_slope=False)
    estimate = replace(
        blank,
        n_edges=n,
        n_rejected=edges.n_rejected,
        speed_mm_s=speed,
        speed_filtered_mm_s=speed,
        latency_s=latency_s,
        latency_se_s=se_s,
        latency_ci95_s=(latency_s - 1.96 * se_s, latency_s + 1.96 * se_s),
        j0_per_edge_mm2=cost_without_shift(ready, edges),
        j_per_edge_mm2=cost / n,
        stylus_diameter_mm=stylus_diameter_mm(alignment.lines, alignment.x_mm.min(), alignment.x_mm.max()),
        alignment=alignment,
    )
    return common_flags(estimate, ready, edges, window_s)


def _cost(ready: Prepared, latency_s: float) -> tuple[float, np.ndarray]:
    """J(L) of Eq. 2, mm², and the edges used."""
    touch, edges = ready.touch, ready.edges
    at_s = edges.t_s + latency_s
    keep = in_contact(touch.t_s, at_s, contact_losses(touch.t_s))
    if np.count_nonzero(keep) < FEWEST_EDGES:
        return np.inf, keep
    x_mm, y_mm = (np.interp(at_s[keep], touch.t_s, v) for v in (touch.x_mm, touch.y_mm))
    half_s = 2.5 * ready.dt_s
    later, earlier = (np.interp(at_s[keep] + sign * half_s, touch.t_s, touch.y_mm) for sign in (1, -1))
    try:
        _, residual = fit_lines(x_mm, y_mm, sides(edges.falling[keep], later - earlier), shared_slope=False)
    except ValueError:
        return np.inf, keep
    return float(residual @ residual), keep


def _speed_at(ready: Prepared, at_s: FloatArray) -> float:
    touch = ready.touch
    if (touch.t_s[-1] - touch.t_s[0]) / ready.dt_s > SAVGOL_WINDOW:
        t_s, _, _, speed = savitzky_golay(touch)
        return float(np.mean(np.interp(at_s, t_s, speed)))
    path_mm = np.sum(np.hypot(np.diff(touch.x_mm), np.diff(touch.y_mm)))
    return float(path_mm / (touch.t_s[-1] - touch.t_s[0]))
