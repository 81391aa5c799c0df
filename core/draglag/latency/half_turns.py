"""Latencies half a turn apart that a steady circle fits alike, decided by the other runs of the session."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from draglag.latency.estimate import RunEstimate
from draglag.recording import Run

ALIAS = "alias"
ALIKE = 2.0  # factor of speed within which latencies differ by less than a quarter of a turn. Physical
Window = tuple[float, float]


def decided_by_others(
    runs: Sequence[Run], estimates: Sequence[RunEstimate], estimate_in: Callable[[Run, Window], RunEstimate]
) -> list[RunEstimate]:
    """The estimates, in the order of their runs; of an alias the one within a quarter of a turn of the latency that the
    run nearest in speed has, if any. ``estimate_in``: the estimate of a run within a window of latencies, s."""
    out = list(estimates)
    for k, (run, one) in enumerate(zip(runs, estimates, strict=True)):
        window_s = _window_s(run, one, estimates) if ALIAS in one.flags else None
        if window_s is None:
            continue
        again = estimate_in(run, window_s)
        if again.latency_s is not None and "at_window_end" not in again.flags:
            out[k] = replace(again, flags=(*again.flags, ALIAS))
    return out


def _window_s(run: Run, estimate: RunEstimate, others: Sequence[RunEstimate]) -> Window | None:
    if not run.radius_mm or not estimate.speed_mm_s:
        return None
    known = [
        (abs(np.log(other.speed_mm_s / estimate.speed_mm_s)), other.latency_s)
        for other in others
        if other.latency_s is not None and other.speed_mm_s and ALIAS not in other.flags
    ]
    if not known:
        return None
    apart, latency_s = min(known)
    quarter_s = 0.5 * np.pi * run.radius_mm / estimate.speed_mm_s
    return None if apart > np.log(ALIKE) else (float(latency_s - quarter_s), float(latency_s + quarter_s))
