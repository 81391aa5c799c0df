"""``draglag gap``."""

from __future__ import annotations

from pathlib import Path

import click

from draglag.analysis import with_stylus
from draglag.errors import EstimateError
from draglag.gap.constants import MOST_EFFECTS
from draglag.gap.provisional import Provisional, provisional_term
from draglag.gap.replaying.extended import extended_model
from draglag.gap.results import FLOOR_REACHES, GapReport, Step, stated, unjudged
from draglag.gap.wording import (
    also_in_words,
    check_in_words,
    drift_in_analysis,
    headline,
    law_in_words,
    needs_evidence,
    noise_in_words,
    sizes_of,
    tolerated_in_words,
)
from draglag.gap.workflow import close_gap
from draglag.messages import joined, message
from draglag.model.file import save_model
from draglag.reading.limits import STYLUS_MM
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS, known_effects, title_of
from draglag.system.packages import need
from draglag_app.cli.batch import GAP_COLUMNS, FindingGap
from draglag_app.cli.common import (
    FiniteRange,
    checksum,
    json_option,
    load_session,
    now_utc,
    print_json,
    progress,
    refuse_existing,
    refuse_unknown_runs,
    table,
)
from draglag_app.cli.many import (
    conclude,
    is_one,
    many_options,
    only_many,
    only_one,
    refuse_outputs,
    run_many,
    sessions_in,
)


@click.command("gap")
@click.argument("sessions", metavar="SESSION…", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--max-effects",
    type=click.IntRange(min=0, max=20),
    default=MOST_EFFECTS,
    show_default=True,
    help="Effects to add at most.",
)
@click.option("--without", multiple=True, metavar="ID", help="Leave an effect out of the library; may be repeated.")
@click.option("--report", type=click.Path(path_type=Path), metavar="FILE.html", help="Also write a page with figures.")
@click.option(
    "--include",
    multiple=True,
    metavar="RUN",
    help="Include a run that is excluded for how it went; may be repeated, or `all`.",
)
@click.option("--stylus-mm", type=FiniteRange(*STYLUS_MM, min_open=True), metavar="MM",
              help="Diameter of the stylus, where another was recorded.")  # fmt: skip
@click.option(
    "--provisional",
    is_flag=True,
    help="Close what stays unexplained by a smooth term without a name.",
)
@click.option(
    "--save-model",
    "--model",
    "model_path",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Write the extended model: law, effects with intervals, provenance.",
)
@many_options
@json_option
def gap(
    sessions: tuple[Path, ...],
    max_effects: int,
    without: tuple[str, ...],
    include: tuple[str, ...],
    report: Path | None,
    model_path: Path | None,
    stylus_mm: float | None,
    provisional: bool,
    jobs: int | None,
    scheduler: str | None,
    out: Path | None,
    summary_path: Path | None,
    as_json: bool,
) -> None:
    """Find where SESSION (a session file or an exchange folder) disagrees with the model, name the effects that
    explain it, each with its probability, and show the gap shrink with them; or say what has no name. Of several
    sessions, folders of sessions or globs: a row each, on all cores or on a cluster.

    \b
    Examples:
        draglag gap session.h5
        draglag gap exchange-folder --json
        draglag gap session.h5 --report gap.html
        draglag gap session.h5 --save-model extended.json
        draglag gap measurements --jobs 8 --out gaps.csv --summary gaps.html
    """
    known_effects(without)
    if not is_one(sessions):
        only_one(
            {"--report": report, "--save-model": model_path, "--provisional": provisional, "--stylus-mm": stylus_mm}
        )
        _many(sessions, FindingGap(max_effects, without, include), jobs, scheduler, out, summary_path, as_json)
        return
    only_many({"--out": out, "--summary": summary_path, "--scheduler": scheduler})
    session = sessions[0]
    if report is not None:
        need("matplotlib")
    for path in filter(None, (report, model_path)):
        refuse_existing(path)
    data = with_stylus(load_session(session), stylus_mm)
    refuse_unknown_runs(session, data, include)
    with progress("Explaining the gap") as done:
        result = close_gap(data, max_effects, [e for e in EFFECTS if e not in without], done, include)
    unnamed = provisional_term(result) if provisional else None
    if as_json:
        more = {"provisional": None if unnamed is None else unnamed.to_dict()} if provisional else {}
        print_json({**result.to_dict(), **more})
    _refuse_without_verdict(session, result)
    _write(session, data, result, unnamed, report, model_path)
    if not as_json:
        print_finding(result, report)
        _print_more(data, result, without)
        if provisional:
            nothing = "No provisional term: nothing is unexplained that a smooth term would close."
            click.echo(nothing if unnamed is None else unnamed.words())
        if model_path is not None:
            _print_model(model_path, unnamed)


def _refuse_without_verdict(session: Path, result: GapReport) -> None:
    if result.verdict is None:
        has_remedy = any(". " in words for words in result.missing)  # an estimate's own refusal has one
        remedy = "" if has_remedy else "Record what is missing"
        raise EstimateError(
            message("{session}: no verdict: {missing}", session=session, missing=joined("; ", result.missing)), remedy
        )


def _write(
    path: Path, data: Session, result: GapReport, unnamed: Provisional | None, report: Path | None, model: Path | None
) -> None:
    if report is not None:
        from draglag.report.gap import write_gap_report

        with progress("Simulating the session again") as done:
            write_gap_report(data, result, report, done, unnamed)
    if model is not None:
        save_model(extended_model(data, result, now_utc(), checksum(path)), model)


def _print_model(path: Path, unnamed: Provisional | None) -> None:
    without = "" if unnamed is None else ", without the provisional term: what has no name is no part of a model"
    click.echo(f"Model: {path}{without}")


_SHOWN = (
    ("file", "file", -1), ("screen", "screen", -1), ("verdict", "verdict", -1), ("probability", "probability", 2),
    ("gap_first_mm", "gap first, mm", 3), ("gap_last_mm", "last, mm", 3), ("noise_floor_mm", "floor, mm", 3),
    ("effects", "effects", -1), ("unexplained_by", "unexplained by", -1),
)  # fmt: skip


def _many(
    paths: tuple[Path, ...], work: FindingGap, jobs: int | None, scheduler: str | None, out: Path | None,
    summary: Path | None, as_json: bool,
) -> None:  # fmt: skip
    refuse_outputs(out, summary)
    outcomes = run_many(work, sessions_in(paths), "Explaining gaps", jobs, scheduler)
    legend = "The gap, from 0 mm, before and after each effect, on one scale; dashed: the noise floor."
    conclude(outcomes, GAP_COLUMNS, _SHOWN, legend=legend, title="Gaps of many sessions", out=out, summary=summary,
             as_json=as_json)  # fmt: skip


def _print_more(data: Session, result: GapReport, without: tuple[str, ...]) -> None:
    if drift := drift_in_analysis(data, result):
        click.echo(drift)
    if without and result.verdict == "unexplained" and result.stopped_at is None:
        click.echo(f"It may be what was left out of the library: {', '.join(without)}.")
    if left := unjudged(data, result):
        click.echo(left)


def _row_of(step: Step) -> list[str]:
    names = " or ".join(map(title_of, (step.effect, *step.indistinguishable_from)))
    gap = f"{step.gap_before_mm:.3f} → {step.gap_after_mm:.3f}"
    return [names, stated(step.probability), step.where, ", ".join(sizes_of(step)), gap]


def print_finding(result: GapReport, report: Path | None) -> None:
    """Print the report for people."""
    click.echo(headline(result))
    if result.steps:
        heads = ["effect", "probability", "where", "size (95 %)", "gap, mm"]
        click.echo(table(heads, list(map(_row_of, result.steps)), 5))
    click.echo(
        f"Gap on held-out runs {result.gap_first_mm:.3f} → {result.gap_last_mm:.3f} mm, "
        f"noise floor {result.noise_floor_mm:.3f} mm ({FLOOR_REACHES})."
    )
    notes = (also_in_words(result), law_in_words(result.law), check_in_words(result), tolerated_in_words(result))
    for words in filter(None, (*notes, noise_in_words(result))):
        click.echo(words)
    for step in result.steps:
        if needs_evidence(step.covariate, step.gap_before_mm, step.gap_after_mm):
            click.echo(f"{title_of(step.effect)}: {step.evidence}.")
    if result.not_seen:
        click.echo("This session could not have shown:")
        for effect, words in result.not_seen.items():
            click.echo(f"  {title_of(effect)}: {words}")
    if report is not None:
        click.echo(f"Report: {report}")
