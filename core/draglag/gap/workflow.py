"""The whole workflow, from a session to its report."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.check import checked
from draglag.gap.constants import MOST_EFFECTS
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.not_shown import not_shown
from draglag.gap.posterior.judge import judged
from draglag.gap.results import GapReport
from draglag.gap.session_check import what_is_missing
from draglag.gap.steps import reported
from draglag.gap.streams.evidence import inspect
from draglag.gap.traces.run_data import gather
from draglag.gap.traces.searched import searched
from draglag.latency.conduct import Estimates, kept_runs, left_out_as_uneven
from draglag.messages import message
from draglag.provenance import is_simulated
from draglag.recording import Session
from draglag.simulation.effects import effect_class, known_effects
from draglag.system.blas import one_blas_thread

UNFITTED = message(
    "edges that no law can be fitted to: touch or laser misses a large part of most runs, or they are not of one drag"
)
NO_FIT = (EstimateError, np.linalg.LinAlgError, ValueError, FloatingPointError)
Progress = Callable[[float, str], None]


@one_blas_thread
def close_gap(
    session: Session,
    max_effects: int = MOST_EFFECTS,
    candidates: Collection[str] | str | None = None,
    progress: Progress | None = None,
    include: Collection[str] = (),
) -> GapReport:
    """Report on a session without runs that ``analyze`` leaves out; ``missing`` lists what a verdict lacks.

    candidates: effect ids. include: ids of runs to use although they went wrong, or ``all``.

    Raises DataError for an unknown candidate.
    """
    allowed = known_effects(candidates)
    whole = session
    session, excluded, estimates = kept_runs(session, include, searched(session))
    report = _closed(session, estimates, max_effects, allowed, progress or (lambda fraction, text: None))
    if report.missing:
        report = replace(report, missing=(*report.missing, *left_out_as_uneven(whole.runs, excluded)))
    return replace(report, excluded=excluded, simulated=is_simulated(session.devices))


def _closed(
    session: Session, estimates: Estimates, max_effects: int, allowed: frozenset[str], progress: Progress
) -> GapReport:
    missing = what_is_missing(session)
    if missing:
        return GapReport(session.name, None, missing=missing)
    progress(0.05, "streams")
    in_streams, whole = inspect(session)
    named = tuple(item for item in in_streams if item.effect in allowed)
    strange = tuple(item for item in in_streams if item.effect not in allowed)
    progress(0.15, "fitting the present model")
    try:
        ready, first = _first_fit(whole if named else session, whole, estimates)
    except NO_FIT as problem:
        why = problem.message if isinstance(problem, EstimateError) else UNFITTED
        return GapReport(session.name, None, missing=(why,))
    unsure = any(effect_class(s.effect).uneven_ages and not (s.undone and named) for s in in_streams)
    most = max(max_effects - len(named), 0)
    judgement = judged(ready, first, allowed, unsure, most, lambda part, text: progress(0.2 + 0.7 * part, text))
    progress(0.95, "held-out runs")
    report = reported((session, ready), judgement, (named, strange), allowed, max_effects)
    if report.steps:
        progress(0.97, "simulating the session again")
        report = checked(session, report, estimates)
    progress(1.0, "done")
    last = report.last or judgement.base
    return replace(report, not_seen=not_shown(session, last))


def _first_fit(ready: Session, whole: Session, estimates: Estimates) -> tuple[Session, Fit]:
    """The session is repaired if it cannot be fitted as given."""
    try:
        return ready, fit_session(ready, gather(ready, estimates))
    except NO_FIT:
        if whole is ready:
            raise
        return whole, fit_session(whole, gather(whole))
