"""Refits of an acceleration lag."""

from __future__ import annotations

from draglag.gap.fitting.joint import Fit, most_promising
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.recording import Session
from draglag.simulation.effects.acceleration_lag import LAGS_S3_MM, WINDOWS_S, AccelerationLag


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """Refit with the usual smoothing window of the panel, from the most promising size, and with a likelier one."""
    own = AccelerationLag.id
    options = [[*before.terms, Term(own, (lag, WINDOWS_S[0]), (lag,))] for lag in LAGS_S3_MM]
    usual = refit(session, before, most_promising(before, options, before.law))
    if usual is None:
        return []
    *others, found = usual.terms
    windows = [[*others, Term(own, (found.theta[0], window_s), found.sizes)] for window_s in WINDOWS_S]
    likeliest = most_promising(usual, windows, usual.law)
    return [usual] if likeliest is windows[0] else [usual, refit(session, before, likeliest)]
