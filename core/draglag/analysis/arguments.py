"""The arguments of an analysis, checked against what its session holds and what can be."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from draglag.analysis.session import Analysis, AnalysisOptions
from draglag.arguments import names_of, number_in, refused, text_of, truth_of
from draglag.errors import DataError
from draglag.messages import message
from draglag.provenance import source_of
from draglag.reading.limits import STYLUS_MM
from draglag.recording import Session

RATE_HZ = (1.0, 10_000.0)
"""Rates of a loop that is emulated: one event a second, and ten times the fastest touchscreens."""

LATENCY_S = (-2.0, 5.0)
"""Latencies that are searched: a prediction is early, no drag is 5 s late."""

ALL = "all"  # the word for every run
_LISTED = 20  # runs that a sentence lists


def checked_options(session: Session, options: AnalysisOptions) -> AnalysisOptions:
    """The options in their types. Raises DataError for what is out of bounds, and for unknown runs."""
    if not isinstance(options.exclude, Mapping) or not all(isinstance(why, str) for why in options.exclude.values()):
        raise DataError("exclude names runs without a reason", 'Give one for each, as in exclude={"run-01": "slipped"}')
    rate_hz, stylus_mm = options.update_rate_hz, options.stylus_mm
    exclude = dict(options.exclude)
    known_runs(session, exclude)
    return AnalysisOptions(
        estimator=text_of("estimator", options.estimator),
        update_rate_hz=None if rate_hz is None else number_in("update_rate_hz", rate_hz, *RATE_HZ),
        window_s=_window_s(options.window_s),
        form=text_of("form", options.form),
        tie_asymptote=truth_of("tie_asymptote", options.tie_asymptote),
        exclude=exclude,
        include=kept_runs_of(session, options.include),
        stylus_mm=None if stylus_mm is None else number_in("stylus_mm", stylus_mm, *STYLUS_MM, above=True),
    )


def kept_runs_of(session: Session, given: object) -> frozenset[str]:
    """Ids of runs to keep, or ``all``. Raises DataError for an unknown one."""
    names = names_of("include", given)
    known_runs(session, (name for name in names if name != ALL))
    return frozenset(names)


def known_runs(session: Session, ids: Iterable[object]) -> None:
    """Raises DataError for an id of no run."""
    runs = [run.id for run in session.runs]
    unknown = [name for name in ids if name not in runs]
    if unknown:
        more = ", …" if len(runs) > _LISTED else ""
        raise DataError(
            message("{path}: there is no run {name}", path=session.name, name=repr(unknown[0])),
            message("Its runs are {runs}", runs=", ".join(runs[:_LISTED]) + more),
        )


def of_session(session: Session, analysis: Analysis) -> None:
    """Raises DataError where the analysis is of another session, by name, start and runs."""
    runs = {(run.id, run.protocol, run.nominal_speed_mm_s) for run in session.runs}
    same = analysis.source in (None, source_of(session)) and analysis.session == session.name
    if not same or not {(run.id, run.protocol, run.nominal_speed_mm_s) for run in analysis.runs} <= runs:
        raise DataError(
            message("{session}: the analysis is of another session, {other}", session=session.name,
                    other=analysis.session),
            "Analyse this one: dl.analyze(session)",
        )  # fmt: skip


def _window_s(given: object) -> tuple[float, float]:
    try:
        low_s, high_s = (number_in("window_s", end, *LATENCY_S) for end in given)  # type: ignore[attr-defined]
    except (TypeError, ValueError, DataError):
        low_s, high_s = 0.0, 0.0
    if isinstance(given, Mapping | set | frozenset) or not low_s < high_s:
        wanted = message(
            "Give the smallest and the largest latency in seconds, from {low:g} to {high:g}, as in window_s=(0, 0.4)",
            low=LATENCY_S[0],
            high=LATENCY_S[1],
        )
        raise refused("window_s", given, wanted)
    return low_s, high_s
