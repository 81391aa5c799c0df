"""An estimator for draglag: the latency whose two lines the edges miss by the least absolute distance.

Squares follow single wild edges; absolute distances hardly do. The interval is the jackknife's over groups of edges.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.latency.common import alignment_at, common_flags, cost_without_shift
from draglag.latency.estimate import Prepared, RunEstimate
from draglag.path.events import contact_losses, in_contact

GROUPS = 10  # of the jackknife
COARSE_S, FINE_S, AROUND_S = 0.004, 0.00025, 0.006


def estimate(ready: Prepared, blank: RunEstimate, window_s: tuple[float, float]) -> RunEstimate:
    """The latency of one run; without figures, and flagged, where its edges do not determine one."""
    coarse_s = np.arange(window_s[0], window_s[1] + COARSE_S / 2, COARSE_S)
    edges = _placed(ready, window_s)
    try:
        middle_s = coarse_s[int(np.argmin([_missed_mm(ready, edges, at_s).mean() for at_s in coarse_s]))]
        fine_s = np.arange(middle_s - AROUND_S, middle_s + AROUND_S, FINE_S)
        missed_mm = np.array([_missed_mm(ready, edges, at_s) for at_s in fine_s])  # (latencies, edges)
    except ValueError:  # too few edges, or all on one side of the beam
        return replace(blank, flags=("unidentifiable",))
    latency_s = _lowest(fine_s, missed_mm.mean(1))
    group = np.arange(missed_mm.shape[1]) % GROUPS
    without_s = np.array([_lowest(fine_s, missed_mm[:, group != k].mean(1)) for k in range(GROUPS)])
    se_s = float(np.sqrt((GROUPS - 1) / GROUPS * np.sum((without_s - without_s.mean()) ** 2)))
    shown = alignment_at(ready, edges, np.full(edges.t_s.size, latency_s))
    found = replace(
        blank,
        n_edges=edges.t_s.size,
        speed_mm_s=float(shown.speed_mm_s.mean()),
        latency_s=latency_s,
        latency_se_s=se_s,
        latency_ci95_s=(latency_s - 1.96 * se_s, latency_s + 1.96 * se_s),
        j0_per_edge_mm2=cost_without_shift(ready, edges),
        j_per_edge_mm2=float(np.mean(shown.residual_mm**2)),
        alignment=shown,
    )
    return common_flags(found, ready, edges, window_s)


def _placed(ready: Prepared, window_s: tuple[float, float]):  # type: ignore[no-untyped-def]
    """The edges that the touch trace covers at every latency searched."""
    t_s, losses_s = ready.touch.t_s, contact_losses(ready.touch.t_s)
    ends = [in_contact(t_s, ready.edges.t_s + shift, losses_s) for shift in window_s]
    return ready.edges.take(ends[0] & ends[1])


def _missed_mm(ready: Prepared, edges, latency_s: float) -> np.ndarray:  # type: ignore[no-untyped-def]
    """(m,) by how much each edge misses its line at that latency. Raises ValueError where a side has no edge."""
    return np.abs(alignment_at(ready, edges, np.full(edges.t_s.size, latency_s)).residual_mm)


def _lowest(at_s: np.ndarray, cost: np.ndarray) -> float:
    """Where the parabola through the lowest cost and its neighbours is lowest."""
    k = int(np.clip(np.argmin(cost), 1, cost.size - 2))
    left, mid, right = cost[k - 1 : k + 2]
    bend = left - 2 * mid + right
    shift = 0.5 * (left - right) / bend if bend > 0 else 0.0
    return float(at_s[k] + np.clip(shift, -1, 1) * (at_s[1] - at_s[0]))
