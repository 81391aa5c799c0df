"""Latencies half a turn apart that a steady circle fits alike, decided by the other runs of the session."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from draglag.latency.estimate import RunEstimate
from draglag.recording import Run

ALIAS = "alias"
ALIKE = 2.0  # factor of speed within which latencies differ by less than a quarter of a turn. Physical
NEAREST = 3  # runs in speed: of so many one may have a wrong latency. Derived: the fewest with a majority
AS_WELL = 2.0  # factor of the edges' scatter: half a turn later it is by a factor of ten. Physical: hands are uneven
Window = tuple[float, float]


def decided_by_others(
    runs: Sequence[Run], estimates: Sequence[RunEstimate], estimate_in: Callable[[Run, Window], RunEstimate]
) -> list[RunEstimate]:
    """The estimates, in the order of their runs; of an alias the one within a quarter of a turn of the latency that the
    runs nearest in speed have, if any. An estimate farther off is an alias, too, where one fits as well within it.

    ``estimate_in``: the estimate of a run within a window of latencies, s."""
    out = list(estimates)
    for k, (run, one) in enumerate(zip(runs, estimates, strict=True)):
        window_s = _window_s(run, one, [*estimates[:k], *estimates[k + 1 :]])
        if window_s is None or (one.latency_s is not None and window_s[0] <= one.latency_s <= window_s[1]):
            continue
        again = estimate_in(run, window_s)
        if again.latency_s is None or "at_window_end" in again.flags or not _fits_as_well(again, one):
            continue
        out[k] = replace(again, flags=tuple(dict.fromkeys((*again.flags, ALIAS))))
    return out


def _fits_as_well(again: RunEstimate, one: RunEstimate) -> bool:
    if ALIAS in one.flags:
        return True
    if again.j_per_edge_mm2 is None or one.j_per_edge_mm2 is None:
        return False
    return again.j_per_edge_mm2 <= AS_WELL**2 * one.j_per_edge_mm2


def _window_s(run: Run, estimate: RunEstimate, others: Sequence[RunEstimate]) -> Window | None:
    if not run.radius_mm or not estimate.speed_mm_s:
        return None
    known = sorted(
        (abs(np.log(other.speed_mm_s / estimate.speed_mm_s)), other.latency_s)
        for other in others
        if other.latency_s is not None and other.speed_mm_s and ALIAS not in other.flags
    )
    near_s = [latency_s for apart, latency_s in known[:NEAREST] if apart <= np.log(ALIKE)]
    if not near_s or (ALIAS not in estimate.flags and len(near_s) < NEAREST):
        return None
    latency_s = float(np.median(near_s if len(near_s) == NEAREST else near_s[:1]))
    quarter_s = 0.5 * np.pi * run.radius_mm / estimate.speed_mm_s
    return latency_s - quarter_s, latency_s + quarter_s
