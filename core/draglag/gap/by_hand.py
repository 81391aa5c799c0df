"""An effect chosen by a person, added to a finished gap report: refitted, judged on held-out runs, looked at again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.blas import one_blas_thread
from draglag.errors import DataError, EstimateError
from draglag.gap.compose import STREAMS, Gap, Model, Shrinkage, shrinkage, theta_of
from draglag.gap.finding.scan import Finding, find
from draglag.gap.fitting.heldout import floor_mm, gap_mm
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.model import LawParameters
from draglag.gap.fitting.parameters import parameters_of, where_of
from draglag.gap.fitting.signatures import SIGNATURES
from draglag.gap.fitting.state import Term
from draglag.gap.naming.doubts import covariate_of, left_out, still_there
from draglag.gap.naming.refits import PLATEAU, SAME_MODEL_BETTER, gained, refit
from draglag.gap.naming.soundness import excess_between_runs, excess_scatter
from draglag.gap.naming.tries import fit_judged
from draglag.gap.results import GapReport, Step
from draglag.gap.streams.evidence import inspect
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS, column_of, effect_class, twins_of

BY_HAND = tuple(effect for effect in EFFECTS if column_of(effect) in (*SIGNATURES, PLATEAU))

SEARCHES = 4  # from where the last one ended
OF_THE_STREAMS = ("frame", "host_tick")  # seen before any fit, which does not change them


@one_blas_thread
def add_by_hand(session: Session, report: GapReport, effect: str) -> GapReport:
    """The report with one more effect, its size fitted jointly with the rest.

    The step says how the gap on held-out runs changed, with its interval, whether or not it shrank.

    Raises DataError for an effect that cannot be added, EstimateError when the model cannot be fitted with it.
    """
    before = report.last
    if before is None or report.finding is None:
        raise EstimateError(f"{report.session}: there is no model to add to", "; ".join(report.missing) or "Try again")
    session = report.judged(session)
    term = column_of(effect)
    there = {column_of(step.effect) for step in report.steps}
    if effect not in BY_HAND:
        raise DataError(f"{effect} cannot be fitted to edges", f"Choose one of {', '.join(BY_HAND)}")
    if term in there:
        raise DataError(f"{effect} is in the model already, or one like it", "Choose another effect")
    repaired = inspect(session)[1] if there & set(STREAMS) else session
    plateau = before.law.plateau_mm_s > 0 or effect == PLATEAU
    terms = list(before.terms) if effect == PLATEAU else [*before.terms, Term(term, theta_of(before, term))]
    try:
        fit = fit_judged(repaired, before, terms, plateau)
    except (np.linalg.LinAlgError, ValueError) as problem:
        raise EstimateError(f"the model cannot be fitted with {effect}: {problem}", "Choose another effect") from None
    finding = find(fit, without=left_out(frozenset(EFFECTS)) | there | {term})
    # The model's own search may have stopped short: an effect is not credited for that.
    without = before if effect == PLATEAU else _searched_from(fit.law, repaired, before)
    changed = shrinkage(_gap(session, without, report.finding), _gap(session, fit, finding))
    low, high = changed.change_ci95_mm
    step = Step(
        effect,
        parameters_of(effect, fit),
        where_of(effect, fit),
        effect_class(effect).follows,
        next((c.p_value for c in report.finding.candidates if c.effect == term), 1.0),
        f"added by hand; held-out gap changed by {low:+.3f} to {high:+.3f} mm (95 %): {changed.verdict}",
        changed.before_mm,
        changed.after_mm,
        twins_of(effect),
        effect_class(effect).shown_apart_by,
        fit=fit,
    )
    left = _left(report, fit, finding, changed)
    settled = [replace(s, parameters=parameters_of(s.effect, fit) or s.parameters) for s in report.steps]
    verdict = "unexplained" if left else "explained"
    if not left and report.verdict == "no_gap" and changed.verdict != "shrinks":
        verdict = "no_gap"
    return replace(
        report,
        verdict=verdict,
        steps=(*settled, step),
        noise_floor_mm=floor_mm(fit),
        gap_last_mm=gap_mm(fit),
        unexplained_by=left,
        p_value=finding.p_value,
        last=fit,
        finding=finding,
    )


def _searched_from(law: LawParameters, session: Session, before: Fit) -> Fit:
    """The model's own best point as sought from another law, as long as that gains."""
    best = before
    for _ in range(SEARCHES):
        own = refit(session, before, before.terms, before.law.plateau_mm_s > 0, law)
        if own is None or gained(best, own) < SAME_MODEL_BETTER:
            break
        best, law = own, own.law
    return best


def _left(report: GapReport, fit: Fit, finding: Finding, changed: Shrinkage) -> str | None:
    """What a gap still follows, or None: what was unexplained is not explained by an effect that closes nothing."""
    left = still_there(fit, finding) if finding.significant else None
    if left is not None:
        return covariate_of(left)
    if report.verdict != "unexplained":
        return None
    if changed.verdict != "shrinks" or report.unexplained_by in OF_THE_STREAMS:
        return report.unexplained_by
    again = {"scatter": excess_scatter, "run": excess_between_runs, "turn": excess_between_runs}
    still = again[report.unexplained_by](fit) if report.unexplained_by in again else None
    return None if still is None else still.covariate


def _gap(session: Session, fit: Fit, finding: Finding) -> Gap:
    return Gap(session, Model(), fit, finding, (), gap_mm(fit), floor_mm(fit))
