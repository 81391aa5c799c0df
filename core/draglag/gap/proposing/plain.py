"""A joint refit with given terms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.fitting.model import LawParameters
from draglag.gap.fitting.state import Term
from draglag.recording import Session


def refit(
    session: Session,
    before: Fit,
    terms: Sequence[Term],
    law: LawParameters | None = None,
) -> Fit | None:
    """Refit on the edges of ``before``. law: initial."""
    law = before.law if law is None else law
    try:
        return fit_session(session, before.runs, terms, law.plateau_mm_s > 0, before, law)
    except (EstimateError, np.linalg.LinAlgError, FloatingPointError, ValueError):
        return None
