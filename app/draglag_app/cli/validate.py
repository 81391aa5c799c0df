"""``draglag validate``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from draglag.errors import EstimateError
from draglag.messages import message
from draglag.provenance import is_simulated
from draglag.recording import FloatArray, Run, Session
from draglag_app.cli.common import (
    flags_block,
    json_option,
    load_session,
    number,
    print_json,
    progress,
    session_argument,
    table,
    warn,
)

if TYPE_CHECKING:
    from draglag.gap.correction import Correction
    from draglag.validation.misalignment import Validation

BINS_MM_S = [0, 25, 50, 100, 150, 200, 300, 400, 600, 800, 1000, 1500]


@click.command("validate")
@session_argument
@click.option("--model", "model_path", required=True, type=click.Path(path_type=Path), help="Made by --save-model.")
@click.option("--all", "all_runs", is_flag=True, help="Circles too, not only runs whose speed varies.")
@click.option("--hold-ends", is_flag=True, help="Hold the curve at its slowest and fastest speed, not extrapolate.")
@click.option(
    "--smoothed/--raw",
    default=False,
    help="Place the edges on the smoothed movement; --raw, the default, interpolates the events as the paper does.",
)
@json_option
def validate(session: Path, model_path: Path, all_runs: bool, hold_ends: bool, smoothed: bool, as_json: bool) -> None:
    """Apply the latency model of one session to the runs of another and say how much of the misalignment of their
    edges it removes (the paper's Eq. 4), per run and averaged over repeats. Effects of an extended model (a drifting
    clock, a skewed scan …) are taken out of the session first.

    \b
    Examples:
        draglag analyze monday.h5 --save-model model.json
        draglag validate tuesday.h5 --model model.json
    """
    from draglag.analysis import has_constant_speed
    from draglag.gap.correction import corrected
    from draglag.latency.conduct import kept_runs
    from draglag.latency.estimate import prepare
    from draglag.model.file import left_unexplained, load_model, other_screen
    from draglag.validation.misalignment import validate_run

    model = load_model(model_path)
    warn(left_unexplained(model))
    whole, excluded, _ = kept_runs(load_session(session))
    warn(*(f"{run} is excluded: {why}" for run, why in excluded.items()))
    data, correction = corrected(whole, model)
    elsewhere = other_screen(model, data.screen.name)
    runs = [run for run in data.runs if all_runs or not has_constant_speed(run)] or list(data.runs)

    def law(speed_mm_s: FloatArray) -> FloatArray:
        return model.latency_s(speed_mm_s, extrapolate=not hold_ends)

    def validated(run: Run) -> Validation:
        return validate_run(prepare(run, data.stylus.diameter_mm), law, model.speed_range_mm_s, smoothed)

    done, problems = _each(runs, validated)
    if not done:
        raise EstimateError(
            message("{session}: no run could be validated", session=session),
            problems[0] if problems else "It holds no runs",
        )
    if as_json:
        about = {"file": str(model_path), "form": model.form, "session": model.provenance.session}
        more = {"other_screen": elsewhere, "excluded": excluded, "problems": problems}
        print_json({**_results(data, about, done, correction), **more})
        return
    click.echo(f"{data.name}, with the model of {model.provenance.session or model_path}")
    warn(elsewhere)
    if model.effects:
        click.echo(correction.words())
    click.echo()
    click.echo("\n\n".join([_table(done), *flags_block(flag for item in done for flag in item.flags)]))
    click.echo(_means(done))
    for problem in problems:
        click.echo(f"not done: {problem}", err=True)


def _results(data: Session, about: dict[str, str], done: list[Validation], correction: Correction) -> dict[str, object]:
    from draglag.analysis import mean_by_protocol

    return {
        "session": data.name,
        "simulated": is_simulated(data.devices),
        "model": about,
        "validation": [_with_histogram(item) for item in done],
        "validation_mean": mean_by_protocol(done),
        "not_compensated": list(correction.left_but_law),
        **correction.to_dict(),
    }


def _each(runs: list[Run], validated: Callable[[Run], Validation]) -> tuple[list[Validation], list[str]]:
    done: list[Validation] = []
    problems: list[str] = []
    with progress("Validating") as on_progress:
        for k, run in enumerate(runs):
            if on_progress:
                on_progress(k / len(runs), run.id)
            try:
                done.append(validated(run))
            except EstimateError as error:
                problems.append(str(error))
    return done, problems


def _with_histogram(item: Validation) -> dict[str, Any]:
    count = np.histogram(item.speeds_mm_s, [*BINS_MM_S, np.inf])[0].tolist()
    return {**item.to_dict(), "speed_histogram": {"from_mm_s": BINS_MM_S, "count": count}}


def _table(done: list[Validation]) -> str:
    rows = [
        [
            item.run,
            item.protocol,
            str(item.n_edges),
            number(item.j0_per_edge_mm2, 2),
            number(item.j_per_edge_mm2, 4),
            number(item.delta_j_percent, 2),
            "{:.0f} to {:.0f}".format(*np.percentile(item.speeds_mm_s, [5, 95])),
            ", ".join(item.flags) or "ok",
        ]
        for item in done
    ]
    head = ["run", "target", "edges", "J(0)/N mm²", "J/N mm²", "ΔJ %", "speeds mm/s", "verdict"]
    return table(head, rows, left=2)


def _means(done: list[Validation]) -> str:
    from draglag.analysis import mean_by_protocol

    means = [
        f"  {row['protocol']}: ΔJ {number(row['delta_J_percent'], 2)} %, J(0)/N {number(row['J0_per_edge_mm2'], 2)} mm²"
        f" over {row['n_runs']} runs"
        for row in mean_by_protocol(done)
    ]
    return "\nMean of each target\n" + "\n".join(means)
