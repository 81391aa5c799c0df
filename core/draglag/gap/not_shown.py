"""Effects that a session cannot show."""

from __future__ import annotations

import numpy as np

from draglag.gap.constants import ENOUGH_TAPS, WIDE_ENOUGH
from draglag.gap.fitting.joint import Fit, effects_in
from draglag.messages import message
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS, column_of

CHANGING = ("chirp", "multisine", "step")
TOO_SUDDEN = message("a slower chirp or step: no edge of those here could be placed surely")


def not_shown(session: Session, fit: Fit) -> dict[str, str]:
    """Effect id → recording that would show it."""
    lacks = _lacking(session, fit)
    inside = set(effects_in(fit))
    out = {}
    for name, effect in EFFECTS.items():
        if effect.needs not in lacks or column_of(name) in inside - {name}:
            continue  # where its column is in the model, the step of that effect names this one as its rival
        out[name] = lacks[effect.needs] or effect.identifiable_with
    return out


def _lacking(session: Session, fit: Fit) -> dict[str, str]:
    """Need → words; empty: those of each effect."""
    out = {"other stylus": ""}
    if session.taps is None or session.taps.registered_s.size < ENOUGH_TAPS:
        out["taps"] = ""
    if not any(np.count_nonzero(fit.run_index == k) for k, data in enumerate(fit.runs) if not data.steady):
        out["changing speed"] = TOO_SUDDEN if any(run.protocol in CHANGING for run in session.runs) else ""
    if float(np.ptp(fit.view.x_mm)) < WIDE_ENOUGH * fit.width_mm:
        out["width"] = ""
    return out
