"""Refit of a speed-adaptive filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.constants import LEAST_PRECISION
from draglag.gap.fitting.joint import Fit, gained_nats
from draglag.gap.fitting.model import LawParameters, starting_law
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.traces.run_data import as_shown
from draglag.path.events import first_of_contact
from draglag.recording import FloatArray, Session
from draglag.simulation.effects.speed_adaptive_filter import OF_SCREENS_SD, USUAL, SpeedAdaptiveFilter
from draglag.simulation.effects.speed_adaptive_filter.filtering import (
    Setting,
    cut_off_hz,
    filtered,
)

OWN = SpeedAdaptiveFilter.id
SETTLED = 0.02  # of either parameter's logarithm: a twenty-fifth of what screens differ by
ROUNDS = 4  # after the first refit
LONGEST_STEP = 0.7  # of a logarithm in one round, a factor of two: further, first order says nothing
BEYOND_SCREENS = 3.5  # standard deviations among screens: one in two thousand would have such a filter
BACK = 0.3  # of a step that went too far
# Of a filter's columns, for it is there as a whole. Calibrated: filters of three generators have 0.15 to 1.8 at the
# usual setting or at the one that shows most, other effects less than 0.05.
LEAST_SHARE = 0.1


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """Refit of traces freed of the likeliest filter, if likelier than without.

    Begun at ``theta`` or at the usual filter, as large as its column is in the edges: a multiple of both parameters
    divides the delay.
    """
    begun = Setting(*theta[:2]) if theta else USUAL
    share = shown_share(before, begun)
    if share < LEAST_SHARE:
        return []
    begun = begun.moved(np.full(2, -np.log(share)))
    best = None if _beyond_screens(begun) else _at(session, before, begun)
    if best is None:
        return []
    step, unsure, gain = likelier(best)
    for _ in range(ROUNDS):
        if gained_nats(before, best) + gain < 0:
            return []  # not even to first order does it come up to a fit without a filter
        there = _setting(best).moved(np.clip(step, -LONGEST_STEP, LONGEST_STEP))
        if _beyond_screens(there):
            return []
        if np.max(np.abs(step)) < SETTLED:
            break
        fit = _at(session, before, there, best.law)
        if fit is None or gained_nats(best, fit) < 0:
            step = BACK * step
        else:
            best = fit
            step, unsure, gain = likelier(fit)
    if gained_nats(before, best) < 0:
        return []
    setting = _setting(best)._replace(sd_log_fmin=float(unsure[0]), sd_log_beta=float(unsure[1]))
    return [replace(best, terms=tuple(replace(t, theta=setting) if t.effect == OWN else t for t in best.terms))]


def _beyond_screens(setting: Setting) -> bool:
    return bool(np.max(np.abs(setting.logs_from(USUAL))) > BEYOND_SCREENS * OF_SCREENS_SD)


def shown_share(before: Fit, setting: Setting) -> float:
    """Size of a filter's column next to the fit's terms, by one linear step: 1 where the filter is there."""
    column = SpeedAdaptiveFilter.signature_of(setting, before.view).columns(before.view)
    a = before.white.apply(np.column_stack([before.design, column]))
    precision = np.diag(np.append(before.prior, LEAST_PRECISION))
    return float(
        (np.linalg.pinv(a.T @ a + precision, hermitian=True) @ (a.T @ before.white.apply(before.residual_mm)))[-1]
    )


def _at(session: Session, before: Fit, setting: Setting, law: LawParameters | None = None) -> Fit | None:
    """Refit freed of one filter. law: initial; None: without its mean delay."""
    law = law or _law_without(before, setting)
    return None if law is None else refit(session, before, [*before.terms, Term(OWN, setting, (0.0, 0.0))], law)


def _setting(fit: Fit) -> Setting:
    return Setting(*fit.terms[-1].theta[:2])


def likelier(fit: Fit) -> tuple[FloatArray, FloatArray, float]:
    """Step (2,) of both logarithms by edges and prior, standard deviations (2,), and the nats that the step gains.

    The filter's term is the last.
    """
    white, prior, own = fit.white, fit.prior.copy(), slice(-2, None)
    prior[own] = OF_SCREENS_SD**-2
    a, b = white.apply(np.column_stack([fit.design[:, :-2], _columns(fit)])), white.apply(fit.residual_mm)
    covariance = np.linalg.pinv(a.T @ a + np.diag(prior), hermitian=True)
    moment = a.T @ b
    moment[own] -= _setting(fit).logs_from(USUAL) * prior[own]
    gain = 0.5 * float(moment @ covariance @ moment)
    return (covariance @ moment)[own], np.sqrt(np.diag(covariance)[own]), gain


def _columns(fit: Fit) -> FloatArray:
    """Displacement per unit of each logarithm, (m, 2) mm, from single events with their noise."""
    traces, setting = fit.view.averaged, _setting(fit)
    first = first_of_contact(traces.t_s)
    behind_mm = traces.xy_mm[:, 1] - filtered(traces.t_s, traces.xy_mm, setting, first)[:, 1]
    at_rest = setting.fmin_hz / cut_off_hz(traces.t_s, traces.xy_mm, setting, first)
    return np.asarray(traces.rows @ (behind_mm[:, None] * np.column_stack([at_rest, 1 - at_rest])))


def _law_without(before: Fit, setting: Setting) -> LawParameters | None:
    """Eq. 5 through latencies less the filter's mean delay."""
    try:
        return starting_law(before.runs, _mean_delays_s(before, setting), False)
    except EstimateError:
        return None


def _mean_delays_s(before: Fit, setting: Setting) -> FloatArray:
    """Mean delay at each run's edges, (runs,)."""
    out = np.zeros(len(before.runs))
    for k, data in enumerate(as_shown(before.runs)):
        cut_off = cut_off_hz(data.t_s, data.xy_mm, setting, first_of_contact(data.t_s))
        out[k] = float(np.mean(np.interp(data.edge_t_s + data.guess_s, data.t_s, 1 / (2 * np.pi * cut_off))))
    return out
