"""Refits of a prediction."""

from __future__ import annotations

from draglag.gap.constants import PROMISING
from draglag.gap.fitting.joint import Fit, gained_nats
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.traces.run_data import as_shown
from draglag.recording import Session
from draglag.simulation.effects.prediction import STEP, WINDOW_S, Prediction, horizon_of
from draglag.simulation.effects.prediction.noise import nats_against

OTHER_WINDOWS_S = (WINDOW_S / STEP, WINDOW_S * STEP)
SETTLED = 0.05  # of a horizon: what is left of it at its setting is known to first order
ROUNDS = 2  # after the first refit at a window


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """Refits of its column and of traces before it, with other windows if the latter are likelier."""
    mean = refit(session, before, [*before.terms, Term(Prediction.id)])
    usual = None if mean is None else _undone(session, before, mean, WINDOW_S)
    if mean is None or usual is None or gained_nats(usual, mean) > 0:
        return [mean, usual]
    fits = [usual, *(_undone(session, before, usual, window_s) for window_s in OTHER_WINDOWS_S)]
    best = max((fit for fit in fits if fit is not None), key=lambda fit: gained_nats(before, fit))
    for _ in range(ROUNDS):
        setting_s, window_s = best.terms[-1].theta
        again = _undone(session, before, best, window_s, setting_s)
        if again is None:
            break
        best = again
    return [mean, best]


def possible_in(before: Fit) -> bool:
    """Whether the noise of the touch events may have been extrapolated with them: a tracker's is smoothed."""
    return nats_against(as_shown(before.runs)) <= PROMISING


def _undone(session: Session, before: Fit, found: Fit, window_s: float, setting_s: float = 0.0) -> Fit | None:
    """Refit of traces before it, at this window and the fitted horizon, if that is another than ``setting_s``."""
    size_s2 = float(Prediction.whole_sizes(found.terms[-1], found)[0])
    horizon_s = horizon_of(size_s2, window_s) if size_s2 > 0 else 0.0
    if not 0 < horizon_s < Prediction.parameters[0].upper or abs(horizon_s - setting_s) < SETTLED * horizon_s:
        return None
    return refit(session, before, [*before.terms, Term(Prediction.id, (horizon_s, window_s), (0.0,))], found.law)
