"""``draglag analyze``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from draglag.analysis import Analysis, AnalysisOptions, with_stylus
from draglag.analysis import analyze as analyze_session
from draglag.analysis.arguments import LATENCY_S, RATE_HZ
from draglag.analysis.tables import RUN_COLUMNS
from draglag.curve import FORMS
from draglag.errors import DataError, EstimateError
from draglag.latency.estimate import WINDOW_S
from draglag.latency.estimators import OWN, estimator_names
from draglag.messages import message
from draglag.reading.limits import STYLUS_MM
from draglag.recording import Session
from draglag.system.packages import need
from draglag_app.cli.analysis_words import analysis_in_words
from draglag_app.cli.batch import ANALYSIS_COLUMNS, AT_MM_S, Analysing
from draglag_app.cli.common import (
    FiniteRange,
    json_option,
    keep_result,
    load_with_state,
    print_json,
    progress,
    refuse_existing,
    refuse_unknown_runs,
    warn,
)
from draglag_app.cli.curve_model import save_curve
from draglag_app.cli.many import (
    conclude,
    is_one,
    many_options,
    only_many,
    only_one,
    refuse_outputs,
    run_many,
    sessions_in,
    write_table,
)

if TYPE_CHECKING:
    from draglag.gap.correction import Correction


def _known_estimator(ctx: click.Context, param: click.Parameter, value: str) -> str:
    if value not in OWN and value not in estimator_names():
        raise click.BadParameter(f"{value!r} is not one of {', '.join(map(repr, estimator_names()))}.", ctx, param)
    return value


@click.command("analyze")
@click.argument("sessions", metavar="SESSION…", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--estimator",
    callback=_known_estimator,
    metavar="[efficient|paper|NAME]",
    default="efficient",
    show_default=True,
    help="The efficient estimator, Eq. 1–3 as published, or one of another package (docs/estimators.md).",
)
@click.option(
    "--update-rate",
    "update_rate_hz",
    type=FiniteRange(*RATE_HZ),
    metavar="HZ",
    help="Emulate a loop that holds the last event (the paper: 100). Default: the kernel's own stamps.",
)
@click.option(
    "--form", type=click.Choice(["best", *FORMS]), default="best", show_default=True, help="Shape of the curve."
)
@click.option("--tie-asymptote", is_flag=True, help="Fix the asymptote to the median release tap.")
@click.option(
    "--window-ms",
    "window_ms",
    nargs=2,
    type=FiniteRange(1e3 * LATENCY_S[0], 1e3 * LATENCY_S[1]),
    metavar="FROM TO",
    help="Latencies to search. Default: 0 400.",
)
@click.option(
    "--include",
    multiple=True,
    metavar="RUN",
    help="Include a run that is excluded for how it went (aborted, …); may be repeated; all: every run.",
)
@click.option("--exclude", multiple=True, metavar="RUN[=WHY]", help="Exclude a run from the curve; may be repeated.")
@click.option("--stylus-mm", type=FiniteRange(*STYLUS_MM, min_open=True), metavar="MM",
              help="Diameter of the stylus, where another was recorded: latencies hardly depend on it, the check of "
                   "its width and what counts as a bounce of the laser do.")  # fmt: skip
@click.option("--save-model", type=click.Path(path_type=Path), metavar="FILE.json", help="Write the curve as a model.")
@click.option(
    "--model",
    "model_path",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Take the effects of an extended model (gap --model) out of the session first.",
)
@click.option(
    "--save/--no-save", default=None, help="Store the result in the session file, next to the raw data [default: save]."
)
@click.option("--report", type=click.Path(path_type=Path), metavar="DIR", help="Also write report.html and figures.")
@click.option("--runs", "runs_out", type=click.Path(path_type=Path), metavar="TABLE.csv|.parquet",
              help="Of many sessions: write the table of their runs, a row each.")  # fmt: skip
@many_options
@json_option
def analyze(
    sessions: tuple[Path, ...],
    estimator: str,
    update_rate_hz: float | None,
    form: str,
    tie_asymptote: bool,
    window_ms: tuple[float, float] | None,
    include: tuple[str, ...],
    exclude: tuple[str, ...],
    stylus_mm: float | None,
    save_model: Path | None,
    model_path: Path | None,
    save: bool | None,
    report: Path | None,
    runs_out: Path | None,
    jobs: int | None,
    scheduler: str | None,
    out: Path | None,
    summary_path: Path | None,
    as_json: bool,
) -> None:
    """Estimate the latency of every run of SESSION (a session file or an exchange folder), the curve of latency
    against speed, tap latencies, and what the curve removes in the validation runs. Of several sessions, folders of
    sessions or globs: a row each, on all cores or on a cluster; one that fails does not end the others.

    \b
    Examples:
        draglag analyze session.h5
        draglag analyze session.h5 --estimator paper --update-rate 100 --json
        draglag analyze session.h5 --no-save --report report
        draglag analyze session.h5 --window-ms 0 600 --save-model model.json
        draglag analyze measurements --out screens.csv --runs runs.csv --summary screens.html
        draglag analyze 'measurements/*.h5' --scheduler tcp://cluster:8786 --out screens.parquet
    """
    if window_ms and not window_ms[0] < window_ms[1]:
        raise click.UsageError("--window-ms runs from a smaller to a larger latency.")
    excluded = {name: why or "excluded by hand" for name, _, why in (text.partition("=") for text in exclude)}
    window_s = (1e-3 * window_ms[0], 1e-3 * window_ms[1]) if window_ms else WINDOW_S
    options = AnalysisOptions(
        estimator, update_rate_hz, window_s, form, tie_asymptote, excluded, frozenset(include), stylus_mm
    )
    if not is_one(sessions):
        only_one({"--exclude": exclude, "--save-model": save_model, "--model": model_path, "--report": report})
        _many(
            sessions, options, save,
            runs_out=runs_out, jobs=jobs, scheduler=scheduler, out=out, summary=summary_path, as_json=as_json,
        )  # fmt: skip
        return
    only_many({"--runs": runs_out, "--out": out, "--summary": summary_path, "--scheduler": scheduler})
    _one(
        sessions[0], options, save, save_model=save_model, model_path=model_path, report=report, as_json=as_json
    )  # fmt: skip


def _one(
    session: Path,
    options: AnalysisOptions,
    save: bool | None,
    *,
    save_model: Path | None,
    model_path: Path | None,
    report: Path | None,
    as_json: bool,
) -> None:
    _refuse_early(session, bool(save), report, save_model)
    read, state = load_with_state(session, analysed=True)
    data, correction = _corrected(read, model_path, options.stylus_mm)
    refuse_unknown_runs(session, data, {*options.exclude, *options.include})
    with progress("Analysing") as done:
        analysis = analyze_session(data, options, done)
    result = analysis.to_dict()
    if correction is not None:
        result |= {"model": str(model_path), **correction.to_dict()}
    if save is not False:
        keep_result(session, state, result, options.kept(str(model_path or "")), must=bool(save))
    _write(session, data, analysis, save_model, report)
    _print(analysis, result, correction, model_path, as_json)
    _refuse_without_latency(session, analysis)


def _print(
    analysis: Analysis, result: dict[str, Any], correction: Correction | None, model_path: Path | None, as_json: bool
) -> None:
    if as_json:
        print_json(result)
        return
    about = "" if correction is None else f"{model_path}: {correction.words() or 'the model names no effect'}\n\n"
    click.echo(about + "\n\n".join(analysis_in_words(analysis, result)))


def _refuse_early(session: Path, save: bool, report: Path | None, save_model: Path | None) -> None:
    if save and not session.is_file():
        raise DataError(
            message("{session}: only a session file can keep a result", session=session),
            "Import it first, or leave --save out",
        )
    if report is not None:
        if (report / "report.html").exists():
            raise DataError(
                message("{path}: exists already and is not overwritten", path=report / "report.html"),
                "Choose another folder",
            )
        need("matplotlib")
    if save_model is not None:
        refuse_existing(save_model)


def _corrected(data: Session, model_path: Path | None, stylus_mm: float | None) -> tuple[Session, Correction | None]:
    if model_path is None:
        return data, None
    from draglag.gap.correction import corrected
    from draglag.model.file import left_unexplained, load_model, other_screen

    model = load_model(model_path)
    warn(other_screen(model, data.screen.name), left_unexplained(model))
    without, correction = corrected(with_stylus(data, stylus_mm), model)
    return replace(without, stylus=data.stylus), correction  # the report says both diameters


def _write(session: Path, data: Session, analysis: Analysis, save_model: Path | None, report: Path | None) -> None:
    if save_model is not None:
        save_curve(save_model, session, data, analysis)
    if report is not None:
        from draglag.report import write_report

        write_report(data, analysis, report)


def _refuse_without_latency(session: Path, analysis: Analysis) -> None:
    if analysis.runs and all(run.latency_s is None for run in analysis.runs):
        why = ", ".join(dict.fromkeys(flag.replace("_", " ") for run in analysis.runs for flag in run.flags))
        raise EstimateError(
            message(
                "{session}: none of {n} runs gave a latency ({why})", session=session, n=len(analysis.runs), why=why
            ),
            "Check that the laser sees the stylus cross the beam, and record again",
        )


_SHOWN = (
    ("file", "file", -1), ("screen", "screen", -1), ("n_latencies", "runs", 0),
    *((f"latency_{v:.0f}_mm_s_ms", f"ms at {v:.0f} mm/s", 1) for v in AT_MM_S),
    ("tap_touch_ms", "tap ms", 1), ("rms_ms", "RMS ms", 2), ("form", "curve", -1),
)  # fmt: skip


def _many(
    paths: tuple[Path, ...], options: AnalysisOptions, save: bool | None, runs_out: Path | None, jobs: int | None,
    scheduler: str | None, out: Path | None, summary: Path | None, as_json: bool,
) -> None:  # fmt: skip
    refuse_outputs(out, summary)
    refuse_outputs(runs_out)
    outcomes = run_many(Analysing(options, save), sessions_in(paths), "Analysing", jobs, scheduler)
    if runs_out is not None:
        rows = [row for outcome in outcomes for row in outcome.runs]
        write_table(rows, ["file", "session", *RUN_COLUMNS], runs_out)
    legend = "Latency, from 0 ms, against drag speed, from 0 mm/s: runs and the fitted curve, all on one scale."
    conclude(outcomes, ANALYSIS_COLUMNS, _SHOWN, legend=legend, title="Latency of many sessions", out=out,
             summary=summary, as_json=as_json)  # fmt: skip
