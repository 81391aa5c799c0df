"""A session's estimates: runs → curve → taps → validation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from draglag.analysis.axes_or_light import axes_or_light
from draglag.curve import CurveFit, CurvePoints, fit_best, fit_form
from draglag.errors import DataError, EstimateError
from draglag.instruments.clocks import remapped
from draglag.instruments.taps import TapSummary, summarise_taps
from draglag.latency import RunEstimate, estimate_on_clock, with_systematics
from draglag.latency.batched import batch_warnings
from draglag.latency.budget import common_delay_u_s
from draglag.latency.conduct import gives_point, left_out_as_uneven, recorded_again, why_excluded, with_conduct
from draglag.latency.estimate import WINDOW_S, prepare
from draglag.latency.estimators import estimator_of
from draglag.latency.half_turns import decided_by_others
from draglag.latency.on_clock import nearby, tap_uncertainty_s, warnings_of
from draglag.latency.stamps import stamps_reach_s, with_stamps
from draglag.latency.steady import changing_warnings, has_constant_speed
from draglag.messages import message
from draglag.provenance import Source, source_of
from draglag.reading.off_screen import off_screen
from draglag.recording import Run, Session
from draglag.shown import table_html
from draglag.system.blas import one_blas_thread
from draglag.validation.misalignment import Validation, validate_run
from draglag.validation.sanity_checks import (
    AsymptoteCheck,
    ClockDrift,
    WidthCheck,
    asymptote_check,
    clock_drifts,
    width_check,
    width_findings,
)

FAR_OFF_S = 0.003  # more than runs of one screen differ for no known reason: the paper's RMS is 1.4 to 2.2 ms

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class AnalysisOptions:
    """How to analyse; see ``draglag.analyze``."""

    estimator: str = "efficient"
    update_rate_hz: float | None = None
    window_s: tuple[float, float] = WINDOW_S
    form: str = "best"
    tie_asymptote: bool = False
    exclude: Mapping[str, str] = field(default_factory=dict)
    include: frozenset[str] = frozenset()
    stylus_mm: float | None = None

    def kept(self, model: str = "") -> dict[str, Any]:
        """JSON as stored with a result; ``model``: file of the correction."""
        return {
            "estimator": self.estimator,
            "update_rate_hz": self.update_rate_hz,
            "form": self.form,
            "tie_asymptote": self.tie_asymptote,
            "window_s": list(self.window_s),
            "exclude": dict(self.exclude),
            "include": sorted(self.include),
            "stylus_mm": self.stylus_mm,
            "model": model,
        }


@dataclass(frozen=True)
class Analysis:
    """All estimates of one session.

    ``curve``: None with too few speeds. ``excluded``: run id → why not in the curve. ``repeated``: run id → the run
    recorded in its place. ``problems``: what failed.
    """

    session: str
    options: AnalysisOptions
    runs: tuple[RunEstimate, ...]
    curve: CurveFit | None
    taps: Mapping[str, TapSummary]
    validation: tuple[Validation, ...]
    problems: tuple[str, ...] = ()
    asymptote: tuple[AsymptoteCheck, ...] = ()
    width: WidthCheck | None = None
    clocks: tuple[ClockDrift, ...] = ()
    warnings: tuple[str, ...] = ()
    excluded: Mapping[str, str] = field(default_factory=dict)
    repeated: Mapping[str, str] = field(default_factory=dict)
    source: Source | None = None

    def in_curve(self, run: RunEstimate) -> bool:
        """Whether a run is a point of the curve."""
        return self.curve is not None and run.id not in self.excluded and gives_point(run)

    def to_dict(self) -> dict[str, object]:
        """JSON of ``analyze --json``."""
        return {
            "session": self.session,
            "simulated": self.source is not None and self.source.simulated,
            "estimator": self.options.estimator,
            "update_rate_hz": self.options.update_rate_hz,
            "runs": [run.to_dict() | {"in_curve": self.in_curve(run)} for run in self.runs],
            "curve": None if self.curve is None else self.curve.to_dict(),
            "taps": {name: summary.to_dict() for name, summary in self.taps.items()},
            "validation": [item.to_dict() for item in self.validation],
            "validation_mean": mean_by_protocol(self.validation),
            "verification": {
                "asymptote": [check.to_dict() for check in self.asymptote],
                "stylus_width": None if self.width is None else self.width.to_dict(),
                "clocks": [drift.to_dict() for drift in self.clocks],
            },
            "excluded": dict(self.excluded),
            "repeated": dict(self.repeated),
            "problems": list(self.problems),
            "warnings": list(self.warnings),
        }

    def __repr__(self) -> str:
        known = sum(run.latency_s is not None for run in self.runs)
        curve = "no curve" if self.curve is None else repr(self.curve)
        return f"Analysis({self.session!r}: {known} of {len(self.runs)} runs with a latency, {curve})"

    def _repr_html_(self) -> str:
        from draglag.analysis.tables import run_rows

        keys = ["run", "speed_mm_s", "latency_ms", "latency_low_ms", "latency_high_ms", "n_edges", "flags"]
        rows = [[row[key] for key in keys] for row in run_rows(self)]
        curve = "" if self.curve is None else self.curve._repr_html_()
        return table_html(f"Analysis of {self.session}", keys, rows) + curve

    def to_dataframe(self) -> Any:
        """A pandas DataFrame, a row a run (``tables.RUN_COLUMNS``)."""
        from draglag.analysis.tables import RUN_COLUMNS, frame_of, run_rows

        return frame_of(run_rows(self), list(RUN_COLUMNS))

    def to_xarray(self) -> Any:
        """An xarray Dataset: runs along ``run``, curve and band along ``speed_mm_s``."""
        from draglag.analysis.tables import dataset_of

        return dataset_of(self)

    def plot(self, ax: Any = None) -> Any:
        """Matplotlib axes with runs, curve and taps (Fig. 5)."""
        from draglag.drawing.results import draw_latency, own_axes

        axes = own_axes(ax)
        draw_latency(axes, self)
        return axes


@one_blas_thread
def analyze(session: Session, options: AnalysisOptions | None = None, progress: Progress | None = None) -> Analysis:
    """All estimates of a session. Raises EstimateError for an unknown estimator or curve form, or a width of no
    stylus.
    """
    options = options or AnalysisOptions()
    estimator_of(options.estimator)
    session = with_stylus(session, options.stylus_mm)
    on_progress = progress or (lambda fraction, text: None)
    steady = [run for run in session.runs if has_constant_speed(run)]
    reach_s = stamps_reach_s([run.touch.t_s for run in session.runs])

    def estimate_in(run: Run, window_s: tuple[float, float]) -> RunEstimate:
        found = estimate_on_clock(
            run, session.clocks, session.stylus.diameter_mm, options.estimator, options.update_rate_hz, window_s
        )
        known = with_systematics(found, correct=options.estimator != "paper")
        return with_conduct(with_stamps(known, max(reach_s, stamps_reach_s([run.touch.t_s]))), run)

    estimates = []
    for k, run in enumerate(steady):
        on_progress(k / max(len(session.runs), 1), run.id)
        estimates.append(estimate_in(run, options.window_s))
    estimates = decided_by_others(steady, estimates, estimate_in)
    badly_run = why_excluded(session.runs, estimates, options.include)
    excluded = {**badly_run, **options.exclude}
    repeated = recorded_again(session.runs, estimates, badly_run)
    standing = [e for e in estimates if e.id not in repeated]
    problems: list[str] = [
        message("{run}: no latency ({flags})", run=e.id, flags=", ".join(e.flags))
        for e in standing
        if e.latency_s is None
    ]
    tap_bound_s = tap_uncertainty_s(session.taps, session.clocks)
    taps = summarise_taps(session.taps, tap_bound_s)
    curve, trouble = _curve(session.runs, estimates, excluded, taps, options, reach_s)
    problems += trouble
    validation, trouble = _validate(session, curve, options, excluded, on_progress)
    problems += trouble
    width = width_check(estimates, session.stylus.diameter_mm)
    warnings = [*warnings_of(session, standing, {"WALT": tap_bound_s}), *_off_the_curve(curve)]
    warnings += [*axes_or_light(steady, estimates, session.stylus.diameter_mm), *_data_warnings(session)]
    warnings += changing_warnings([one.run for one in validation if one.protocol == "free"])
    warnings += width_findings(width, [e for e in estimates if e.id not in excluded])
    on_progress(1.0, "done")
    return Analysis(
        session=session.name,
        options=options,
        runs=tuple(estimates),
        curve=curve,
        taps=taps,
        validation=tuple(validation),
        problems=tuple(problems),
        asymptote=tuple(asymptote_check(curve, taps)) if curve is not None else (),
        width=width,
        clocks=tuple(clock_drifts(session)),
        warnings=tuple(warnings),
        excluded=excluded,
        repeated=repeated,
        source=source_of(session),
    )


def with_stylus(session: Session, diameter_mm: float | None) -> Session:
    """The session with that diameter of its stylus; None: as recorded. Raises EstimateError for one of no stylus."""
    if diameter_mm is None:
        return session
    if not 0 < diameter_mm < np.inf:
        raise EstimateError(
            message("a stylus cannot be {diameter_mm:g} mm wide", diameter_mm=diameter_mm), "Measure its diameter"
        )
    return replace(session, stylus=replace(session.stylus, diameter_mm=diameter_mm))


def mean_by_protocol(validation: Sequence[Validation]) -> list[dict[str, object]]:
    """Eq. 4 averaged over the repeats of each protocol (Table 3)."""
    out: list[dict[str, object]] = []
    for protocol in dict.fromkeys(item.protocol for item in validation):
        same = [item for item in validation if item.protocol == protocol]
        out.append(
            {
                "protocol": protocol,
                "n_runs": len(same),
                "J0_per_edge_mm2": float(np.mean([item.j0_per_edge_mm2 for item in same])),
                "J_per_edge_mm2": float(np.mean([item.j_per_edge_mm2 for item in same])),
                "delta_J_percent": float(np.mean([item.delta_j_percent for item in same])),
            }
        )
    return out


def curve_points(estimates: Sequence[RunEstimate]) -> CurvePoints:
    """Points of the runs with a finite standard error, inside the window."""
    good = [
        (e.speed_mm_s, e.latency_s, e.curve_se_s, e.speed_se_mm_s or 0.0, e.speed_sd_mm_s or 0.0)
        for e in estimates
        if gives_point(e)
    ]
    table = np.array(good, float).reshape(-1, 5)
    return CurvePoints(table[:, 0], table[:, 1], table[:, 2], table[:, 3], table[:, 4])


def _curve(
    runs: Sequence[Run],
    estimates: Sequence[RunEstimate],
    excluded: Mapping[str, str],
    taps: Mapping[str, TapSummary],
    options: AnalysisOptions,
    reach_s: float,
) -> tuple[CurveFit | None, list[str]]:
    tied_s, tied_se_s = None, 0.0
    problems: list[str] = []
    if options.tie_asymptote:
        if "release" in taps:
            tied_s, tied_se_s = taps["release"].median_s, taps["release"].median_se_s
        else:
            problems.append(message("the asymptote could not be tied: the session has no release taps"))
    points = curve_points([e for e in estimates if e.id not in excluded])
    try:
        if options.form == "best":
            curve = fit_best(points, tied_s, tied_se_s=tied_se_s)
        else:
            curve = fit_form(points, options.form, tied_s, tied_se_s)
        return (curve if options.tie_asymptote else _with_common_shift(curve, reach_s)), problems
    except KeyError:
        raise EstimateError(
            message("unknown curve form {form}", form=repr(options.form)), "See draglag analyze --help"
        ) from None
    except EstimateError as error:
        uneven = left_out_as_uneven(runs, excluded)  # more runs of that kind would be left out, too
        return None, [*problems, EstimateError(error.problem, uneven[0]).message if uneven else error.message]


def _with_common_shift(curve: CurveFit, reach_s: float) -> CurveFit:
    """The curve with the delay uncertainty common to all runs in its asymptote."""
    covariance = curve.covariance.copy()
    covariance[-1, -1] += 1e6 * (common_delay_u_s() ** 2 + reach_s**2 / 3)
    return replace(curve, covariance=covariance)


def _data_warnings(session: Session) -> list[str]:
    of_file = (note.text for note in session.notes if note.level == "warning" and note.source == "file")
    return [*batch_warnings(session.runs), *off_screen(session.screen, session.runs), *of_file]


def _off_the_curve(curve: CurveFit | None) -> list[str]:
    if curve is None or curve.points is None or curve.between_runs_s < FAR_OFF_S:
        return []
    return [
        message(
            "Runs lie {off:.1f} ms off the curve beyond their own errors: something other than speed moves "
            "their latency, or the curve is too simple for them. See what draglag gap finds before using the "
            "curve.",
            off=1e3 * curve.between_runs_s,
        )
    ]


def _with_hindsight(run: Run, session: Session) -> Run:
    try:
        return remapped(run, nearby(run, session.clocks))
    except DataError:
        return run


def _validate(
    session: Session,
    curve: CurveFit | None,
    options: AnalysisOptions,
    excluded: Mapping[str, str],
    on_progress: Progress,
) -> tuple[list[Validation], list[str]]:
    varying = [run for run in session.runs if not has_constant_speed(run) and run.id not in excluded]
    if curve is None:
        return [], [message("{run}: not validated, there is no curve", run=run.id) for run in varying]
    out: list[Validation] = []
    problems: list[str] = []
    before = len(session.runs) - len(varying)
    for k, run in enumerate(varying, before):
        on_progress(k / len(session.runs), run.id)
        try:
            ready = prepare(_with_hindsight(run, session), session.stylus.diameter_mm, options.update_rate_hz)
            out.append(validate_run(ready, curve.predict_s, curve.speed_range_mm_s))
        except EstimateError as error:
            problems.append(error.message)
    return out, problems
