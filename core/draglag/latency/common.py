"""What both estimators share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.instruments.beam import fit_lines, sides
from draglag.latency.edges import Edges
from draglag.latency.estimate import FEW_EDGES, Alignment, Prepared, RunEstimate
from draglag.path.local_fit import local_fit
from draglag.recording import FloatArray

# In diameters. Below it, up and down cross the beam at places of their own, and a slope looks like a latency: standard
# errors are three times those of a whole diameter, and without any travel wrong by more than they say.
LITTLE_TRAVEL = 0.25
TURNS_APART = 2.0  # of a circle, between two places of its centre: a turn averages the circle out. Derived


def alignment_at(ready: Prepared, edges: Edges, latency_s: FloatArray, shared_slope: bool = True) -> Alignment:
    """Each edge on the screen without and with its shift. Raises ValueError if a side is empty."""
    touch = ready.touch
    raw = [np.interp(edges.t_s, touch.t_s, v) for v in (touch.x_mm, touch.y_mm)]
    at_s = edges.t_s + latency_s
    x_mm, y_mm = (np.interp(at_s, touch.t_s, v) for v in (touch.x_mm, touch.y_mm))
    fit = local_fit(touch.t_s, ready.xy_mm, at_s, 4.5 * ready.dt_s, degree=2)
    v_mm_s = fit.v_mm_s
    side = sides(edges.falling, v_mm_s[:, 1])
    lines, residual = fit_lines(x_mm, y_mm, side, shared_slope)
    return Alignment(
        edge_t_s=edges.t_s,
        x_raw_mm=raw[0],
        y_raw_mm=raw[1],
        x_mm=x_mm,
        y_mm=y_mm,
        side=side,
        falling=edges.falling,
        residual_mm=residual,
        latency_s=latency_s,
        speed_mm_s=fit.speed_mm_s,
        v_mm_s=v_mm_s,
        lines=lines,
    )


def cost_without_shift(ready: Prepared, edges: Edges, v_across_mm_s: FloatArray | None = None) -> float | None:
    """J(0) / N of Eq. 4, mm²; None if a side is empty."""
    touch = ready.touch
    if v_across_mm_s is None:
        v_across_mm_s = local_fit(touch.t_s, ready.xy_mm, edges.t_s, 4.5 * ready.dt_s, degree=2).v_mm_s[:, 1]
    x_mm, y_mm = (np.interp(edges.t_s, touch.t_s, v) for v in (touch.x_mm, touch.y_mm))
    try:
        _, residual = fit_lines(x_mm, y_mm, sides(edges.falling, v_across_mm_s), shared_slope=False)
    except ValueError:
        return None
    return float(np.mean(residual**2))


def common_flags(
    estimate: RunEstimate,
    ready: Prepared,
    edges: Edges,
    window_s: tuple[float, float],
    extra: tuple[str, ...] = (),
) -> RunEstimate:
    """The estimate with flags from its figures, and its travel."""
    flags = list(extra)
    if edges.t_s.size < FEW_EDGES:
        flags.append("few_edges")
    total = edges.t_s.size + edges.n_rejected
    if edges.n_rejected > max(2, 0.1 * total):
        flags.append("spurious_edges")
    flags += _flags_of_latency(estimate, window_s)
    off_mm2 = estimate.j_per_edge_mm2
    if off_mm2 is not None and off_mm2 > (0.5 * ready.stylus_diameter_mm) ** 2:
        flags.append("excess_scatter")  # so far from its line that it could be the other one
    if ready.run.laser.missed:
        flags.append("missed_edges")
    if ready.run.touch.gaps_s.size or ready.run.laser.gaps_s.size:
        flags.append("device_gap")
    if ready.n_strays:
        flags.append("stray_touches")
    travel = _travel(ready)
    if travel is not None and travel < LITTLE_TRAVEL:
        flags.append("little_travel")
    known = list(dict.fromkeys(flags))
    if "unidentifiable" in known:
        return replace(
            estimate,
            latency_s=None,
            latency_se_s=None,
            latency_ci95_s=None,
            travel_per_diameter=travel,
            flags=tuple(known),
        )
    return replace(estimate, travel_per_diameter=travel, flags=tuple(known))


def _flags_of_latency(estimate: RunEstimate, window_s: tuple[float, float]) -> list[str]:
    if estimate.latency_s is None:
        return []
    end_s = 0.004
    inside = window_s[0] + end_s < estimate.latency_s < window_s[1] - end_s
    identified = estimate.latency_se_s is not None and estimate.latency_se_s < 0.01
    return ([] if inside else ["at_window_end"]) + ([] if identified else ["unidentifiable"])


def _travel(ready: Prepared) -> float | None:
    """How far the circle's centre comes along the beam, there and back or on and on, in diameters."""
    run, touch = ready.run, ready.touch
    if not run.radius_mm or touch.t_s.size < 5:
        return None
    every = max(1, touch.t_s.size // 2000)
    t_s, x_mm = touch.t_s[::every] - touch.t_s[0], touch.x_mm[::every]
    turns, around = 0.0, []
    if run.nominal_speed_mm_s:
        angle = run.nominal_speed_mm_s / run.radius_mm * t_s
        turns, around = float(angle[-1]) / (2 * np.pi), [np.cos(angle), np.sin(angle)]
    knots_s = np.linspace(0.0, t_s[-1], max(int(turns / TURNS_APART), 1) + 1)
    centre = [np.interp(t_s, knots_s, one) for one in np.eye(knots_s.size)]
    fit = np.linalg.lstsq(np.column_stack([*centre, *around]), x_mm, rcond=None)[0]
    return float(np.ptp(fit[: knots_s.size]) / (2 * run.radius_mm))
