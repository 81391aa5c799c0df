"""Refits of an acceleration lag."""

from __future__ import annotations

from draglag.gap.fitting.joint import Fit, most_promising
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.recording import Session
from draglag.simulation.effects.acceleration_lag import LAGS_S3_MM, WINDOWS_S, AccelerationLag


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """One refit per smoothing window of the panel, from the most promising size."""
    own = AccelerationLag.id
    options = [[*before.terms, Term(own, (lag, WINDOWS_S[0]), (lag,))] for lag in LAGS_S3_MM]
    *others, begun = most_promising(before, options, before.law)
    terms = [[*others, Term(own, (begun.theta[0], window_s), begun.sizes)] for window_s in WINDOWS_S]
    return [refit(session, before, each) for each in terms]
