"""A filter that follows the speed: the traces freed of it, at the setting that the edges ask for."""

from __future__ import annotations

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.fitting.joint import Fit, log_likelihood_on
from draglag.gap.fitting.model import LawParameters, starting_law
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.traces.run_data import as_shown
from draglag.recording import FloatArray, Session
from draglag.simulation.effects.speed_adaptive_filter import SpeedAdaptiveFilter
from draglag.simulation.effects.speed_adaptive_filter.filtering import Setting, cut_off_hz, first_of_contact

SETTLED = 0.02  # of either parameter's logarithm: what is left at the setting is known to first order
ROUNDS = 5
FURTHEST = 1.0  # of a logarithm in one round: further, first order says nothing


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """The traces freed of it, from the setting at which its columns explain most, until nothing is left at it."""
    if not theta:
        return []
    own, setting = SpeedAdaptiveFilter.id, Setting(*theta)
    law = _law_without(before, setting)
    found: Fit | None = None
    for _ in range(ROUNDS):
        fit = None if law is None else refit(session, before, [*before.terms, Term(own, setting, (0.0, 0.0))], law)
        if fit is None or _worse(fit, before):
            break
        found, law = fit, fit.law
        left = np.array(fit.terms[-1].sizes)
        if np.max(np.abs(left)) < SETTLED:
            break
        setting = Setting(*(np.array(setting) * np.exp(np.clip(left, -FURTHEST, FURTHEST))))
    return [found]


def _worse(fit: Fit, before: Fit) -> bool:
    """Whether edges lie farther off than without the filter: then no other setting is looked for from here."""
    both = fit.use & before.use
    return log_likelihood_on(fit, both) < log_likelihood_on(before, both)


def _law_without(before: Fit, setting: Setting) -> LawParameters | None:
    """Eq. 5 through the runs' own latencies, each less the filter's mean delay at its edges."""
    try:
        return starting_law(before.runs, _delays_s(before, setting), False)
    except EstimateError:
        return None


def _delays_s(before: Fit, setting: Setting) -> FloatArray:
    """The filter's mean delay at the edges of each run, by the speed that the trace shows, (runs,) s."""
    out = np.zeros(len(before.runs))
    for k, data in enumerate(as_shown(before.runs)):
        cut_off = cut_off_hz(data.t_s, data.xy_mm, setting, first_of_contact(data.t_s))
        out[k] = float(np.mean(np.interp(data.edge_t_s + data.guess_s, data.t_s, 1 / (2 * np.pi * cut_off))))
    return out
