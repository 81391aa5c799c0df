"""An effect added to a gap report by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from draglag.errors import DataError, EstimateError, message_of
from draglag.gap.compose import Gap, Model, Shrinkage, shown_by_streams, shrinkage, with_one_more
from draglag.gap.constants import PROBABLE, STATED_AT_MOST
from draglag.gap.fitting.heldout import floor_mm, gap_mm, shrinks_or_predicts
from draglag.gap.fitting.joint import Fit, effects_in
from draglag.gap.fitting.parameters import where_of
from draglag.gap.fitting.signatures import COLUMNS
from draglag.gap.posterior.answer import answer_of
from draglag.gap.posterior.judge import Judgement
from draglag.gap.posterior.misfit import parameters_with_misfit
from draglag.gap.posterior.pool import Pool, compared
from draglag.gap.results import GapReport, Step
from draglag.gap.steps import deviance_gained
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.stalls import FOLLOWS as STALLS_FOLLOW
from draglag.messages import joined, message, phrase
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS, column_of, effect_class, twins_of
from draglag.system.blas import one_blas_thread

BY_HAND = tuple(effect for effect in EFFECTS if column_of(effect) in COLUMNS)
OF_THE_STREAMS = (STALLS_FOLLOW, "host_tick")  # detected before any fit, which does not change them


@one_blas_thread
def add_by_hand(session: Session, report: GapReport, effect: str) -> GapReport:
    """Report with one more effect, even if it does not shrink the gap.

    Raises DataError for an effect that cannot be added, EstimateError for one that cannot be fitted.
    """
    before = report.last
    if before is None or report.judgement is None:
        raise EstimateError(
            message("{session}: there is no model to add to", session=report.session),
            joined("; ", report.missing) or "Try again",
        )
    session = report.judged(session)
    _check(report, before, effect)
    repaired = inspect(session)[1] if any(shown_by_streams(step.effect) for step in report.steps) else session
    old = report.judgement
    try:
        fit = with_one_more(repaired, before, column_of(effect), old.pool.unsure_ages)
    except (np.linalg.LinAlgError, ValueError) as problem:
        raise EstimateError(
            message("the model cannot be fitted with {effect}: {problem}", effect=effect, problem=message_of(problem)),
            "Choose another effect",
        ) from None
    fits = {**old.fits, effects_in(fit): fit}
    pool = compared(list(fits.values()), frozenset(EFFECTS), old.pool.unsure_ages)
    changed = shrinkage(_gap(session, before, old.pool), _gap(session, fit, pool))
    step = _step(effect, before, fit, pool, changed)
    # By the rule for every effect, whoever proposed it.
    accepted = step.probability > PROBABLE and shrinks_or_predicts(before, fit)
    left = _left(report, fit, old.pool.unsure_ages, accepted)
    settled = [replace(s, parameters=parameters_with_misfit(s.effect, fit) or s.parameters) for s in report.steps]
    verdict = "unexplained" if left else "explained"
    if not left and report.verdict == "no_gap" and not accepted:
        verdict = "no_gap"
    return replace(
        report,
        verdict=verdict,
        steps=(*settled, step),
        noise_floor_mm=floor_mm(fit),
        gap_last_mm=gap_mm(fit),
        unexplained_by=left,
        explanations=answer_of(pool).explanations,
        last=fit,
        judgement=Judgement(pool, fits),
    )


def _check(report: GapReport, before: Fit, effect: str) -> None:
    if effect not in BY_HAND:
        raise DataError(
            message("{effect} cannot be fitted to edges", effect=effect),
            message("Choose one of {names}", names=", ".join(BY_HAND)),
        )
    there = {column_of(step.effect) for step in report.steps} | set(effects_in(before))
    if column_of(effect) in there:
        raise DataError(
            message("{effect} is in the model already, or one like it", effect=effect), "Choose another effect"
        )


def _step(effect: str, before: Fit, fit: Fit, pool: Pool, changed: Shrinkage) -> Step:
    low, high = changed.change_ci95_mm
    return Step(
        effect,
        parameters_with_misfit(effect, fit),
        where_of(effect, fit),
        effect_class(effect).follows,
        float(chdtrc(max(fit.design.shape[1] - before.design.shape[1], 1), max(deviance_gained(before, fit), 0.0))),
        message(
            "added by hand; held-out gap changed by {low:+.3f} to {high:+.3f} mm (95 %): {verdict}",
            low=low,
            high=high,
            verdict=phrase(changed.verdict),
        ),
        changed.before_mm,
        changed.after_mm,
        min(pool.probability_of(column_of(effect)), STATED_AT_MOST),
        twins_of(effect),
        effect_class(effect).separated_by,
        fit,
    )


def _left(report: GapReport, fit: Fit, unsure_ages: bool, accepted: bool) -> str | None:
    """Covariate of the gap that remains, if any."""
    given = answer_of(compared([fit], frozenset(EFFECTS), unsure_ages))
    if given.unexplained_by is not None:
        return given.unexplained_by
    more = [name for name in given.effects if name not in effects_in(fit)]
    if more:
        return effect_class(more[0]).follows
    # What was unexplained and no edge shows is not explained by an effect that closes nothing.
    closes = accepted and report.unexplained_by not in OF_THE_STREAMS
    return None if report.verdict != "unexplained" or closes else report.unexplained_by


def _gap(session: Session, fit: Fit, pool: Pool) -> Gap:
    return Gap(session, Model(), fit, pool, (), gap_mm(fit), floor_mm(fit))
