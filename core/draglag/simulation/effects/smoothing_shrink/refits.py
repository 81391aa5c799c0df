"""Refits of a low-pass."""

from __future__ import annotations

import numpy as np

from draglag.gap.constants import HOPELESS, P_EFFECT
from draglag.gap.fitting.joint import Fit, gained_nats
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.recording import Session
from draglag.simulation.effects.smoothing_shrink import SmoothingShrink
from draglag.simulation.effects.smoothing_shrink.sharpening import Setting

SETTLED = 0.03  # of a time constant: what is left of it at its setting is known to first order
ROUNDS = 4
LEAST_NATS = -HOPELESS * np.log(P_EFFECT)  # of log-likelihood: with less, no form of it can pay for its name


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """Refits of its column, and of traces freed of a causal and of a symmetric one."""
    own = SmoothingShrink.id
    mean = refit(session, before, [*before.terms, Term(own, theta)])
    if mean is None:
        return []
    out: list[Fit | None] = [mean]
    if gained_nats(before, mean) < LEAST_NATS:
        return out
    for even in (False, True):
        found = mean
        for _ in range(ROUNDS):
            lag_s = parameters_of(own, found)["time_constant_s"][0]
            term = found.terms[-1]
            if not np.isfinite(lag_s) or lag_s <= 0 or (term.theta and abs(lag_s - term.theta[0]) < SETTLED * lag_s):
                break
            sharper = refit(session, before, [*before.terms, Term(own, Setting(lag_s, even).theta, (0.0,))], found.law)
            if sharper is None:
                break
            found = sharper
        out.append(found if found is not mean else None)
    return out
