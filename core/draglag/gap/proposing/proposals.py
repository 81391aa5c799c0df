"""Refits with one more effect."""

from __future__ import annotations

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.of_effect import refit_module
from draglag.gap.proposing.plain import refit
from draglag.recording import Session


def refits_with(session: Session, before: Fit, effect: str, theta: tuple[float, ...]) -> list[Fit]:
    """One refit for each form of the effect. theta: initial setting."""
    own = refit_module(effect)
    if own is not None and hasattr(own, "refits"):
        return [fit for fit in own.refits(session, before, theta) if fit is not None]
    fit = refit(session, before, [*before.terms, Term(effect, theta)])
    return [] if fit is None else [fit]


def shown_by_traces(before: Fit, effect: str) -> float:
    """Nats by which touch events show the effect, whatever its columns promise."""
    own = refit_module(effect)
    return float(own.shown_by_traces(before)) if own is not None and hasattr(own, "shown_by_traces") else 0.0


def possible_in(before: Fit, effect: str) -> bool:
    """Whether touch events allow the effect."""
    own = refit_module(effect)
    return own is None or not hasattr(own, "possible_in") or bool(own.possible_in(before))


def shown_by_edges(before: Fit, effect: str) -> bool:
    """Whether single edges show what the effect's columns do not."""
    own = refit_module(effect)
    return own is not None and hasattr(own, "shown_by_edges") and bool(own.shown_by_edges(before))
