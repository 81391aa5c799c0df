"""The latency of a run, by any estimator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.errors import EstimateError
from draglag.latency.estimate import FEWEST_EDGES, WINDOW_S, RunEstimate, prepare
from draglag.latency.estimators import estimator_of
from draglag.recording import Run


def estimate_run(
    run: Run,
    stylus_diameter_mm: float,
    estimator: str = "efficient",
    update_rate_hz: float | None = None,
    window_s: tuple[float, float] = WINDOW_S,
) -> RunEstimate:
    """Latency of a run at constant speed (Eq. 1); bad data give flags, not errors.

    Args:
        estimator: "efficient" (joint maximum likelihood), "paper" (Eq. 2 on raw events), or another package's.
        update_rate_hz: emulate a loop that takes the last event at this rate.
        window_s: latencies searched.

    Raises EstimateError if the estimator is unknown, or another package's fails.
    """
    one = estimator_of(estimator)
    blank = RunEstimate(run.id, run.protocol, run.nominal_speed_mm_s, "kernel")
    try:
        ready = prepare(run, stylus_diameter_mm, update_rate_hz)
    except EstimateError:
        return replace(blank, flags=("no_touch",))
    blank = replace(blank, stamps=ready.stamps, n_edges=ready.edges.t_s.size, n_rejected=ready.edges.n_rejected)
    if not run.laser.t_s.size:
        return replace(blank, flags=("no_edges",))
    if ready.edges.t_s.size < FEWEST_EDGES:
        return replace(blank, flags=("few_edges", "unidentifiable"))
    try:
        return one(ready, blank, window_s)
    except np.linalg.LinAlgError:  # singular: the data do not determine what was asked
        return replace(blank, flags=("unidentifiable",))
