"""Wider speed windows where the law is steep."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from draglag.path.local_fit import local_fit

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

WIDTHS_S = (0.05, 0.07, 0.095, 0.13, 0.18, 0.25)  # half windows that are tried, a factor of 1.4 apart. Derived
# Of latency, that noise of the speed may make: a third of what runs differ by anyway. Derived.
NOISE_S = 2e-4
BEND_RAD = 1.2  # of the circle within half a window: a cubic's speed is then true to 1 %. Derived
EVERY = 5  # edges, of which one is fitted: a median needs no more. Derived: cost


def wide_enough(runs: tuple[RunData, ...]) -> tuple[RunData, ...]:
    """Runs, circles with speed windows for less than 0.2 ms of latency noise."""
    known = sorted(
        (d.estimate.speed_mm_s, d.estimate.latency_s)
        for d in runs
        if d.estimate is not None and d.estimate.speed_mm_s and d.estimate.latency_s is not None
    )
    speeds, first = np.unique([v for v, _ in known], return_index=True)
    if speeds.size < 3:
        return runs
    slope = np.abs(np.gradient(np.array([late for _, late in known])[first], speeds))
    out = []
    for d in runs:
        e = d.estimate
        if e is None or not d.run.radius_mm or not e.speed_mm_s or e.latency_s is None:
            out.append(d)
            continue
        steepness = float(np.interp(e.speed_mm_s, speeds, slope))
        least_s = 0.0
        for width_s in WIDTHS_S:
            if width_s * e.speed_mm_s > BEND_RAD * d.run.radius_mm:
                break
            least_s = width_s
            fit = local_fit(d.t_s, d.xy_mm, d.edge_t_s[::EVERY] + e.latency_s, width_s)
            if steepness * d.noise_mm * np.sqrt(np.median(fit.v_gain)) < NOISE_S:
                break
        out.append(replace(d, speed_half_s=np.maximum(d.speed_half_s, least_s)))
    return tuple(out)
