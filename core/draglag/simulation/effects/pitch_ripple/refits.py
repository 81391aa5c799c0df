"""Refit of a ripple that touch events show."""

from __future__ import annotations

import numpy as np

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.traces.run_data import as_shown
from draglag.recording import Session
from draglag.simulation.effects.pitch_ripple import PitchRipple, Setting
from draglag.simulation.effects.pitch_ripple.lattice import lattice_in

LEAST_MM = 0.1  # of amplitude, in the touch events: twice the size of interest


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """Refit with the ripple undone in the traces, if any."""
    lattice = lattice_in(as_shown(before.runs))
    if lattice is None:
        return []
    return [refit(session, before, [*before.terms, Term(PitchRipple.id, Setting(lattice.pitch_mm, 1.0))])]


def possible_in(before: Fit) -> bool:
    """Whether touch events show any ripple."""
    return lattice_in(as_shown(before.runs)) is not None


def shown_by_traces(before: Fit) -> float:
    """∞ nats if touch events, by their thousands, show a ripple of a size of interest, else 0."""
    lattice = lattice_in(as_shown(before.runs))
    return np.inf if lattice is not None and float(abs(lattice.sizes_mm).max()) > LEAST_MM else 0.0
