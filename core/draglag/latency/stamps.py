"""Stamps of touch events on a coarse grid: how late they are within it is unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from draglag.latency.budget import COVERAGE_FACTOR, widened
from draglag.latency.estimate import RunEstimate
from draglag.path.events import median
from draglag.recording import FloatArray

COARSE = "coarse_stamps"
LEAST_S = 1e-4  # a finer grid costs less than other delays. Physical
ROUNDING_S, ROUNDING = 3e-6, 0.002  # of stamps written in whole µs, and as a share of the grid. Derived
PARTS = 16  # steps by which intervals differ at least. Derived: frames come a step early or late, or a few
MOST = 0.99  # of the intervals: a stall may leave the grid. Judgement
FEWEST = 8  # intervals that differ from the usual one, or stamps that come twice, where a grid shows. Judgement
# Of the usual interval; of the frames: missing ones leave even ones on their own grid, up to some percent. Physical
BELOW_USUAL, MISSING = 0.9, 0.05


def stamps_reach_s(stamps_s: Sequence[FloatArray]) -> float:
    """By how much stamps of a session, run by run, may be off: half a step of the grid that they lie on, or a whole one
    where several events share one, of which the last is kept; 0 if none shows, or their own frames are the grid."""
    apart_s = np.concatenate([np.empty(0), *(np.diff(np.sort(t_s[np.isfinite(t_s)])) for t_s in stamps_s)])
    own_s = apart_s[apart_s > ROUNDING_S]
    if own_s.size <= FEWEST:
        return 0.0
    usual_s = median(own_s)
    differ_s = np.abs(own_s - usual_s)
    differ_s = differ_s[differ_s > max(ROUNDING_S, ROUNDING * usual_s)]
    first_s = float(np.quantile(differ_s, 1 - MOST)) if differ_s.size >= FEWEST else usual_s
    for step_s in first_s / np.arange(1, PARTS + 1):
        step_s = float(np.sum(own_s) / max(np.sum(np.round(own_s / step_s)), 1))
        if step_s < LEAST_S:
            break
        off_s = np.abs(own_s - step_s * np.round(own_s / step_s))
        if np.mean(off_s < max(ROUNDING_S, ROUNDING * step_s)) >= MOST:
            twice, missing = apart_s.size - own_s.size >= FEWEST, np.mean(own_s > 1.5 * usual_s) > MISSING
            fine = step_s < BELOW_USUAL * usual_s
            return step_s if twice and not fine else 0.5 * step_s if fine or missing else 0.0
    return 0.0


def with_stamps(estimate: RunEstimate, reach_s: float) -> RunEstimate:
    """The estimate, flagged and as uncertain as stamps that may be off by ``reach_s``; 0: unchanged."""
    u_s = reach_s / float(np.sqrt(3.0))
    if not u_s or estimate.latency_s is None or estimate.latency_ci95_s is None:
        return estimate
    half_s = COVERAGE_FACTOR * u_s
    low_s, high_s = (float(np.hypot(end - estimate.latency_s, half_s)) for end in estimate.latency_ci95_s)
    return replace(
        widened(estimate, u_s),
        latency_ci95_s=(estimate.latency_s - low_s, estimate.latency_s + high_s),
        systematic_s=float(np.hypot(estimate.systematic_s, half_s)),
        flags=(*estimate.flags, COARSE),
    )
