"""``draglag compare``: the latency curves of several sessions, and how they differ."""

from __future__ import annotations

from pathlib import Path

import click

from draglag.curve import CurveFit
from draglag.errors import DataError, EstimateError
from draglag.provenance import Source, source_of
from draglag.temporary import new_file
from draglag_app.cli.common import json_option, load_session, number, print_json, progress, refuse_existing, table


@click.command("compare")
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--report", type=click.Path(path_type=Path), metavar="FILE.html", help="Write a page with the figures.")
@json_option
def compare(sessions: tuple[Path, ...], report: Path | None, as_json: bool) -> None:
    """Fit the curve of every session (session files, exchange folders or models) and show how each differs from the
    first, with a 95 % band.

    \b
    Example:
        draglag compare monday.h5 tuesday.h5 --report difference.html
    """
    from draglag.curve.compare import curve_difference

    if len(sessions) < 2:
        raise click.UsageError("Give at least two sessions.")
    if report is not None:
        refuse_existing(report)
    curves: list[tuple[str, CurveFit, Source]] = []
    with progress("Comparing") as report_progress:
        for k, path in enumerate(sessions):
            if report_progress:
                report_progress(k / len(sessions), path.name)
            curves.append((str(path), *_curve_of(path)))
    first = curves[0][1]
    apart = [(name, curve_difference(first, curve)) for name, curve, _ in curves[1:]]
    result = {
        "first": curves[0][0],
        "curves": [
            {"session": name, "simulated": source.simulated, **curve.to_dict()} for name, curve, source in curves
        ],
        "differences": [{"session": name, **(d.to_dict() if d else {"at": []})} for name, d in apart],
    }
    if report is not None:
        from draglag.reproduction.drawings import comparison_page

        try:
            with new_file(report) as growing:
                growing.write_text(comparison_page(curves), "utf-8")
        except OSError as error:
            raise DataError(f"{report}: cannot be written ({error.strerror})", "Check the folder") from error
    if as_json:
        print_json(result)
        return
    for name, difference in apart:
        if difference is None:
            click.echo(f"{name} and {curves[0][0]} share no speeds.")
            continue
        rows = [
            [number(float(v), 0), number(1e3 * float(d), 2), f"{1e3 * a:.2f} to {1e3 * b:.2f}"]
            for v, d, a, b in zip(
                difference.speed_mm_s, difference.difference_s, difference.low_s, difference.high_s, strict=True
            )
        ]
        chance = f"p = {difference.p_value:.2g}" if difference.p_value > 0.0 else "p < 1e-300"
        word = "they differ" if difference.p_value < 0.05 else "no difference beyond chance"
        click.echo(f"{name} minus {curves[0][0]}: {word} ({chance})")
        click.echo(table(["speed mm/s", "difference ms", "95 % band ms"], rows, left=0) + "\n")


def _curve_of(path: Path) -> tuple[CurveFit, Source]:
    """The curve of a session or of a model, and what it is from. Raises EstimateError for a session without one."""
    from draglag.analysis import analyze
    from draglag.model_file import load_model

    if path.suffix == ".json" and path.name != "session.json":
        model = load_model(path)
        return model.curve, model.source
    data = load_session(path)
    curve = analyze(data).curve
    if curve is None:
        raise EstimateError(f"{path}: no curve", "See draglag analyze for the verdict on its runs")
    return curve, source_of(data)
