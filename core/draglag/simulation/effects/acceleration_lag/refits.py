"""Refits of an acceleration lag."""

from __future__ import annotations

import numpy as np

from draglag.gap.fitting.joint import Fit, most_promising
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.traces.edges import Placed
from draglag.recording import FloatArray, Session
from draglag.simulation.effects.acceleration_lag import LAGS_S3_MM, WINDOWS_S, AccelerationLag

END_S = 0.3  # of a trace: three times what an acceleration behind it remembers


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """One refit per smoothing window of the panel, from the most promising size."""
    own = AccelerationLag.id
    options = [[*before.terms, Term(own, (lag, WINDOWS_S[0]), (lag,))] for lag in LAGS_S3_MM]
    *others, begun = most_promising(before, options, before.law)
    terms = [[*others, Term(own, (begun.theta[0], window_s), begun.sizes)] for window_s in WINDOWS_S]
    return [refit(session, before, each, only=judged(before.placed, begun)) for each in terms]


def judged(placed: Placed, term: Term) -> np.ndarray:
    """Edges (m,) away from a trace's ends."""
    at_s = placed.t_s + placed.latency_s
    ends_s = np.array([(data.t_s[0], data.t_s[-1]) for data in placed.traces.runs])[placed.run]
    return np.asarray((at_s > ends_s[:, 0] + END_S) & (at_s < ends_s[:, 1] - END_S))


def open_mm(placed: Placed, term: Term) -> FloatArray:
    """Displacement by the run's typical acceleration, (m,)."""
    out = np.zeros(len(placed))
    for k in np.unique(placed.run):
        own = (placed.run == k) & np.isfinite(placed.accel_apart_mm_s2)
        typical = float(np.sqrt(np.mean(placed.accel_apart_mm_s2[own] ** 2))) if own.any() else 0.0
        out[own] = abs(term.sizes[0]) * typical * np.abs(placed.v_mm_s[own, 1] * placed.stretch[own])
    return out
