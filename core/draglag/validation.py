"""How much of a run's misalignment a latency model removes (Eq. 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.beam import fit_lines, sides
from draglag.compensation import Law, stylus_speed, stylus_time_s
from draglag.errors import EstimateError
from draglag.latency.common import alignment_at
from draglag.latency.edges import Edges
from draglag.latency.estimate import FEWEST_EDGES, Alignment, Prepared
from draglag.motion import (
    LocalFit,
    best_half_width_s,
    contact_losses,
    in_contact,
    local_fit,
    sample_interval_s,
    speed_half_widths_s,
)
from draglag.recording import FloatArray


@dataclass(frozen=True)
class Validation:
    """Eq. 4 for one run. Speeds are those at the crossings; ``n_extrapolated`` of them outside the curve's range."""

    run: str
    protocol: str
    n_edges: int
    j0_per_edge_mm2: float
    j_per_edge_mm2: float
    speeds_mm_s: FloatArray
    latency_s: FloatArray
    n_extrapolated: int
    alignment: Alignment
    flags: tuple[str, ...] = ()

    @property
    def delta_j_percent(self) -> float:
        return 100 * (1 - self.j_per_edge_mm2 / self.j0_per_edge_mm2) if self.j0_per_edge_mm2 > 0 else float("nan")

    def to_dict(self) -> dict[str, object]:
        return {
            "run": self.run,
            "protocol": self.protocol,
            "n_edges": self.n_edges,
            "J0_per_edge_mm2": self.j0_per_edge_mm2,
            "J_per_edge_mm2": self.j_per_edge_mm2,
            "delta_J_percent": self.delta_j_percent,
            "mean_latency_ms": 1e3 * float(np.mean(self.latency_s)),
            "n_extrapolated": self.n_extrapolated,
            "flags": list(self.flags),
        }


def apply_law(
    touch_t_s: FloatArray, xy_mm: FloatArray, edge_t_s: FloatArray, law: Law, noise_mm: float
) -> tuple[FloatArray, FloatArray, LocalFit]:
    """Solve L = law(v) at every edge, v the stylus' own speed at the edge, shown by the touch trace at t + L.

    Args:
        touch_t_s (n,), xy_mm (n, 2), edge_t_s (m,), noise_mm of one event.

    Returns:
        latency_s (m,), speed_mm_s (m,), and the local fit at t + L.
    """
    # The trace in the stylus' own time gives the start; from L(some speed) a bell-shaped movement finds wrong roots.
    own_s = stylus_time_s(touch_t_s, xy_mm, touch_t_s, law, max(0.05, 4.5 * sample_interval_s(touch_t_s)))
    forwards = np.append(np.diff(own_s) > 0, True)
    latency_s = np.interp(edge_t_s, own_s[forwards], touch_t_s[forwards]) - edge_t_s
    half_s = speed_half_widths_s(touch_t_s, xy_mm, edge_t_s + latency_s, noise_mm)
    for _ in range(8):
        fit = local_fit(touch_t_s, xy_mm, edge_t_s + latency_s, half_s)
        speed = stylus_speed(law, fit.v_mm_s, fit.a_mm_s2)
        # Half a step: where L falls by more than a period of the motion a full one would oscillate.
        step = 0.5 * np.clip(law(speed) - latency_s, -0.02, 0.02)
        latency_s = latency_s + step
        if np.max(np.abs(step), initial=0) < 1e-5:
            break
    return latency_s, speed, fit


def validate_run(
    ready: Prepared, law: Law, speed_range_mm_s: tuple[float, float] = (0.0, np.inf), raw: bool = False
) -> Validation:
    """Eq. 4 for one run and one latency law. ``raw`` interpolates the events as the paper does, without smoothing.

    Raises EstimateError when too few edges can be placed or a side is empty.
    """
    touch = ready.touch
    if ready.edges.t_s.size < FEWEST_EDGES:
        raise EstimateError(f"{ready.run.id}: {ready.edges.t_s.size} edges, {FEWEST_EDGES} needed", "Record it again")
    guess_s = ready.edges.t_s + float(law(np.array([300.0]))[0])
    half_s, noise_mm = best_half_width_s(touch.t_s, ready.xy_mm, guess_s)
    latency_s, speed, _ = apply_law(touch.t_s, ready.xy_mm, ready.edges.t_s, law, noise_mm)
    # A step movement's bell stays cubic over no more than about 0.1 s, which leave-one-out over a whole run can miss.
    half_s = min(half_s, max(0.05, 4.5 * ready.dt_s))
    fit = local_fit(touch.t_s, ready.xy_mm, ready.edges.t_s + latency_s, half_s)
    keep = in_contact(touch.t_s, ready.edges.t_s + latency_s, contact_losses(touch.t_s)) & fit.ok
    keep &= in_contact(touch.t_s, ready.edges.t_s, contact_losses(touch.t_s))
    if np.count_nonzero(keep) < FEWEST_EDGES:
        raise EstimateError(f"{ready.run.id}: too few edges lie within the touch trace", "Record it again")
    edges = Edges(ready.edges.t_s[keep], ready.edges.falling[keep], ready.edges.n_rejected)
    latency_s, speed = latency_s[keep], speed[keep]
    try:
        before = alignment_at(ready, edges, np.zeros_like(latency_s), shared_slope=False)
        after = alignment_at(ready, edges, latency_s, shared_slope=False)
        residual = after.residual_mm
        if not raw:
            side = sides(edges.falling, fit.v_mm_s[keep, 1])
            _, residual = fit_lines(fit.xy_mm[keep, 0], fit.xy_mm[keep, 1], side, shared_slope=False)
    except ValueError as problem:
        raise EstimateError(f"{ready.run.id}: {problem}", "Record it again, crossing the beam both ways") from None
    outside = (speed < speed_range_mm_s[0]) | (speed > speed_range_mm_s[1])
    n_outside = int(np.count_nonzero(outside))
    return Validation(
        ready.run.id,
        ready.run.protocol,
        int(edges.t_s.size),
        float(np.mean(before.residual_mm**2)),
        float(np.mean(residual**2)),
        speed,
        latency_s,
        n_outside,
        after,
        ("extrapolated",) if n_outside > 0.1 * edges.t_s.size else (),
    )
