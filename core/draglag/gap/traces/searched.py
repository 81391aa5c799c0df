"""Latencies of single runs, searched where the clocks have drifted to."""

from __future__ import annotations

import numpy as np

from draglag.latency.conduct import Estimates
from draglag.latency.estimate import RunEstimate
from draglag.latency.half_turns import decided_by_others
from draglag.latency.run import estimate_run
from draglag.latency.steady import has_constant_speed
from draglag.recording import Run, Session

SEARCHED_S = (-0.15, 0.45)  # latencies: a clock may be off. Physical
PANELS_S = (0.0, 0.3)  # latencies of panels: as far as a median is beyond, the window moves. Physical
NEIGHBOURS = 5  # runs before one, whose median says where it is searched: two wrong minima do not move it. Derived


def searched(session: Session) -> Estimates:
    """Estimates of the runs at constant speed, (run, estimate) each.

    The window moves with the clocks: two that differ by 60 ppm are 0.2 s apart within an hour.
    """
    found: dict[str, tuple[Run, RunEstimate]] = {}
    before: list[float] = []
    for run in sorted(session.runs, key=lambda run: run.start_s):
        if not has_constant_speed(run):
            continue
        usual_s = float(np.median(before[-NEIGHBOURS:])) if before else PANELS_S[0]
        moved_s = usual_s - float(np.clip(usual_s, *PANELS_S))
        window_s = (SEARCHED_S[0] + moved_s, SEARCHED_S[1] + moved_s)
        estimate = estimate_run(run, session.stylus.diameter_mm, window_s=window_s)
        found[run.id] = run, estimate
        if estimate.latency_s is not None:
            before.append(estimate.latency_s)
    runs, estimates = [run for run, _ in found.values()], [estimate for _, estimate in found.values()]
    width_mm = session.stylus.diameter_mm
    estimates = decided_by_others(runs, estimates, lambda run, window_s: estimate_run(run, width_mm, window_s=window_s))
    known = dict(zip(found, estimates, strict=True))
    return tuple((run, known[run.id]) for run in session.runs if run.id in known)
