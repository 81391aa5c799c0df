"""Misalignment that a latency model removes from a run (Eq. 4)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.errors import EstimateError
from draglag.instruments.beam import Lines, fit_lines, sides
from draglag.latency.common import alignment_at
from draglag.latency.edges import Edges
from draglag.latency.estimate import FEWEST_EDGES, Alignment, Prepared
from draglag.messages import message
from draglag.path.events import contact_losses, in_contact
from draglag.path.inversion import Law, StylusPath, stylus_path
from draglag.path.motion import savitzky_golay
from draglag.recording import FloatArray
from draglag.shown import brief


@dataclass(frozen=True)
class Validation:
    """Eq. 4 for one run, with speeds at the crossings."""

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

    __repr__ = brief


def validate_run(
    ready: Prepared, law: Law, speed_range_mm_s: tuple[float, float] = (0.0, np.inf), smoothed: bool = False
) -> Validation:
    """Eq. 4 for one run and latency law. Raises EstimateError if too few edges can be placed or a side is empty.

    Touch events at t + L(v), v the paper's Savitzky–Golay speed; ``smoothed``: on ``stylus_path``.
    """
    if ready.edges.t_s.size < FEWEST_EDGES:
        raise EstimateError(
            message("{run}: {n} edges, {k} needed", run=ready.run.id, n=ready.edges.t_s.size, k=FEWEST_EDGES),
            "Record it again",
        )
    losses_s = contact_losses(ready.touch.t_s)
    placed = _placed(ready, stylus_path(ready.touch.t_s, ready.xy_mm, law), losses_s) if smoothed else None
    if placed is not None:
        edges, latency_s, speed = placed.edges, placed.latency_s, placed.speed_mm_s
    else:
        edges, latency_s, speed = _shifted(ready, law, losses_s)
    if edges.t_s.size < FEWEST_EDGES or (smoothed and placed is None):
        raise EstimateError(
            message("{run}: too few edges on both sides of the beam lie within the touch trace", run=ready.run.id),
            "Record it again",
        )
    try:
        after = alignment_at(ready, edges, latency_s, shared_slope=False)
        # An edge is a top or a bottom one however late its touch event comes: the same sides for J(0).
        _, uncorrected_mm = fit_lines(after.x_raw_mm, after.y_raw_mm, after.side, shared_slope=False)
    except ValueError as problem:
        raise EstimateError(
            message("{run}: {problem}", run=ready.run.id, problem=problem),
            "Record it again, crossing the beam both ways",
        ) from None
    if placed is not None:
        x_mm, y_mm = placed.xy_mm.T
        after = replace(
            after, x_mm=x_mm, y_mm=y_mm, side=placed.side, residual_mm=placed.residual_mm, lines=placed.lines
        )
    residual = after.residual_mm
    outside = (speed < speed_range_mm_s[0]) | (speed > speed_range_mm_s[1])
    n_outside = int(np.count_nonzero(outside))
    return Validation(
        run=ready.run.id,
        protocol=ready.run.protocol,
        n_edges=int(edges.t_s.size),
        j0_per_edge_mm2=float(np.mean(uncorrected_mm**2)),
        j_per_edge_mm2=float(np.mean(residual**2)),
        speeds_mm_s=speed,
        latency_s=latency_s,
        n_extrapolated=n_outside,
        alignment=after,
        flags=("extrapolated",) if n_outside > 0.1 * edges.t_s.size else (),
    )


def _shifted(ready: Prepared, law: Law, losses_s: FloatArray) -> tuple[Edges, FloatArray, FloatArray]:
    touch = ready.touch
    try:
        grid_s, _, _, speed = savitzky_golay(touch)
    except ValueError as problem:
        raise EstimateError(
            message("{run}: {problem}", run=ready.run.id, problem=problem), "Record it again, for longer"
        ) from None
    lag_s = np.asarray(law(speed), float)
    own_s = np.maximum.accumulate(grid_s - lag_s)
    t_s = ready.edges.t_s
    latency_s, at_mm_s = np.interp(t_s, own_s, lag_s), np.interp(t_s, own_s, speed)
    keep = (t_s >= own_s[0]) & (t_s <= own_s[-1]) & np.isfinite(latency_s)
    keep &= in_contact(touch.t_s, t_s + latency_s, losses_s) & in_contact(touch.t_s, t_s, losses_s)
    return ready.edges.take(keep), latency_s[keep], at_mm_s[keep]


@dataclass(frozen=True)
class _Placed:
    edges: Edges
    latency_s: FloatArray
    speed_mm_s: FloatArray
    xy_mm: FloatArray
    side: FloatArray
    residual_mm: FloatArray
    lines: Lines


def _placed(ready: Prepared, path: StylusPath, losses_s: FloatArray) -> _Placed | None:
    t_s, touch_t_s = ready.edges.t_s, ready.touch.t_s
    latency_s, speed, xy_mm = path.at(t_s)
    keep = (t_s > path.event_t_s[0] + 0.02) & (t_s < path.event_t_s[-1] - 0.02) & np.isfinite(latency_s)
    keep &= in_contact(touch_t_s, t_s + latency_s, losses_s) & in_contact(touch_t_s, t_s, losses_s)
    if np.count_nonzero(keep) < FEWEST_EDGES:
        return None
    across = np.interp(t_s[keep], path.t_s, np.gradient(path.xy_mm[:, 1], path.t_s))
    side = sides(ready.edges.falling[keep], across)
    try:
        lines, residual = fit_lines(xy_mm[keep, 0], xy_mm[keep, 1], side, shared_slope=False)
    except ValueError:
        return None
    edges = Edges(t_s[keep], ready.edges.falling[keep], ready.edges.n_rejected)
    return _Placed(edges, latency_s[keep], speed[keep], xy_mm[keep], side, residual, lines)
