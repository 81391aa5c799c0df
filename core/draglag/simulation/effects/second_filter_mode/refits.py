"""Refits of a second filter, above a speed or by times."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.constants import PROMISING
from draglag.gap.fitting.joint import Fit, gained_nats, latency_of_terms, most_promising
from draglag.gap.fitting.model import LawParameters
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.traces.run_data import as_shown
from draglag.recording import Session
from draglag.simulation.effects.second_filter_mode import SecondFilterMode
from draglag.simulation.effects.second_filter_mode.setting import By, Setting
from draglag.simulation.effects.second_filter_mode.skips import Skips, find_skips
from draglag.simulation.effects.second_filter_mode.stepped import Step, find_step
from draglag.simulation.effects.second_filter_mode.switching import (
    Switching,
    find_switching,
    law_from_levels,
    misassigned_s,
    refine_times,
)

OWN = SecondFilterMode.id
LEFT_OVER = 0.03  # of a lateness undone: what is left is known to first order
ROUNDS = 4
NEAR = 1.025 ** np.arange(-4, 5)  # of a speed found among quantiles, and then of the likeliest


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """One refit for each way in which it shows, where its size gains nats of its own: edges that it leaves unsure weigh
    less, which may gain more than it explains."""
    skips = find_skips(as_shown(before.runs))
    switching = find_switching(before)
    step = _step_of(before)
    setting = Setting.of(theta)
    if skips is not None and skips.above_mm_s is not None:
        setting, skips = skips.setting, None
    out = []
    if step is not None or (setting is not None and setting.by is By.SPEED):
        # Eq. 5 bends about a step, or its bend about a step passes for a form of its own: with either of them.
        own = [before.law] if step is None or before.law.remainder_s else []
        laws = own if step is None else [*own, step.law]
        out += [_above_a_speed(session, before, setting, step, law) for law in laws]
    if setting is not None and setting.by is By.ACCELERATION:
        out.append(refit(session, before, [*before.terms, Term(OWN, theta)]))
    if switching is not None:
        out.append(_switched(session, before, switching))
    if skips is not None:
        out.append(_skipping(session, before, skips))
    return [fit for fit in out if fit is not None and _by_its_size(fit) > PROMISING]


def _by_its_size(fit: Fit) -> float:
    """Nats that the size of the last term gains."""
    (size_s,) = SecondFilterMode.whole_sizes(fit.terms[-1], fit)
    return 0.5 * float(size_s**2 / fit.covariance[-1, -1])


def shown_by_edges(before: Fit) -> bool:
    """Whether edges' latencies lie on two lasting levels, or runs' on two curves, or events skip."""
    found, step = find_switching(before), _step_of(before)
    return (
        (found is not None and found.gain > 0)
        or (step is not None and step.alone)
        or find_skips(as_shown(before.runs)) is not None
    )


def _step_of(before: Fit) -> Step | None:
    """Step of the curve that runs' latencies show next to a fit's effects; none on a plateau."""
    return None if before.law.plateau_mm_s > 0 else find_step(before.runs, latency_of_terms(before))


def _above_a_speed(
    session: Session, before: Fit, setting: Setting | None, step: Step | None, law: LawParameters
) -> Fit | None:
    """Refit above the likeliest speed of single edges or between two runs, in turn with the law. law: initial."""
    speeds = list[float]()
    if setting is not None and setting.by is By.SPEED:
        speeds = [v * setting.above for v in NEAR]
    size_s = SecondFilterMode.parameters[0].typical
    if step is not None:
        speeds, size_s = [*speeds, *step.thresholds_mm_s()], step.size_s
    fit = None
    for _ in range(ROUNDS):
        options = [[*before.terms, Term(OWN, Setting(float(v), By.SPEED).theta, (size_s,))] for v in speeds]
        terms = most_promising(before, options, law)
        if fit is not None and terms[-1].theta == fit.terms[-1].theta:
            break
        found = refit(session, before, terms, law)
        if found is None or (fit is not None and gained_nats(fit, found) <= 0):
            break
        fit, law, size_s = found, found.law, found.terms[-1].sizes[0]
        speeds = [v * terms[-1].theta[0] for v in NEAR]
    return fit


def _switched(session: Session, before: Fit, switching: Switching) -> Fit | None:
    """By times, in turn with the law."""
    fit, law, setting, size_s = None, None, switching.setting, switching.size_s
    for _ in range(ROUNDS):
        fit = refit(session, before, [*before.terms, Term(OWN, setting.theta, (size_s,))], law)
        if fit is None:
            return None
        size_s, last = fit.terms[-1].sizes[0], setting
        setting = refine_times(fit, size_s, setting)
        if (setting == last and law is not None) or not setting.times_s:
            break
        with contextlib.suppress(EstimateError):
            law = law_from_levels(fit, before.law.plateau_mm_s > 0)
    return fit


def _skipping(session: Session, before: Fit, skips: Skips) -> Fit | None:
    """Refit of traces freed of it until little lateness remains."""
    fit, setting = None, skips.setting
    for _ in range(ROUNDS):
        law = None if fit is None else fit.law
        found = refit(session, before, [*before.terms, Term(OWN, setting.theta, (0.0,))], law)
        if found is None:
            return fit
        fit, left_s, mistaken = found, found.terms[-1].sizes[0], misassigned_s(found, setting)
        if abs(left_s) < LEFT_OVER * setting.above and not mistaken:
            break
        # In a stretch of a stretch the filter has let go again; as long as some are mistaken, they make the size.
        late_s = setting.above if mistaken else setting.above + left_s
        setting = replace(setting, above=late_s, times_s=tuple(sorted((*setting.times_s, *mistaken))))
    return fit
