"""Refit of Eq. 5 with a plateau."""

from __future__ import annotations

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.recording import Session
from draglag.simulation.effects.low_speed_plateau import BEYOND_SLOWEST
from draglag.simulation.effects.low_speed_plateau.interval import plateau_ci95_mm_s

__all__ = ["plateau_ci95_mm_s", "refits"]


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """Fit from the runs' latencies; none if only the slowest run lies on the plateau."""
    try:
        fit = fit_session(session, before.runs, before.terms, True, before)
    except (EstimateError, np.linalg.LinAlgError, ValueError, FloatingPointError):
        return []
    slowest = min(float(fit.view.speed[fit.run_index == k].mean()) for k in np.unique(fit.run_index))
    return [fit] if fit.law.plateau_mm_s > BEYOND_SLOWEST * slowest else []
