"""A prediction: the traces before it, at the horizon that the edges ask for with each of some windows."""

from __future__ import annotations

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.recording import Session
from draglag.simulation.effects.prediction import STEP, WINDOW_S, Prediction, horizon_of

WINDOWS_S = (WINDOW_S / STEP, WINDOW_S, WINDOW_S * STEP)
SETTLED = 0.05  # of a horizon: what is left of it at its setting is known to first order
ROUNDS = 3


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """Its effect on curves, and the traces before it with each window."""
    own = Prediction.id
    mean = refit(session, before, [*before.terms, Term(own)])
    if mean is None:
        return []
    out: list[Fit | None] = [mean]
    for window_s in WINDOWS_S:
        found, setting_s = mean, 0.0
        for _ in range(ROUNDS):
            size_s2 = float(Prediction.whole_sizes(found.terms[-1], found)[0])
            horizon_s = horizon_of(size_s2, window_s) if size_s2 > 0 else 0.0
            if not 0 < horizon_s < Prediction.parameters[0].upper or abs(horizon_s - setting_s) < SETTLED * horizon_s:
                break
            term = Term(own, (horizon_s, window_s), (0.0,))
            again = refit(session, before, [*before.terms, term], found.law)
            if again is None:
                break
            found, setting_s = again, horizon_s
        out.append(found if found is not mean else None)
    return out
