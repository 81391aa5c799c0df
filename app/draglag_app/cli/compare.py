"""``draglag compare``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from draglag.curve import CurveFit
from draglag.curve.compare import CurveDifference
from draglag.curve.ranking import Ranking
from draglag.errors import DraglagError, EstimateError
from draglag.messages import message
from draglag.provenance import Source, source_of
from draglag.shown import chance
from draglag.system.packages import need
from draglag_app.cli.common import (
    json_option,
    load_session,
    number,
    print_json,
    progress,
    refuse_existing,
    table,
    written_whole,
)
from draglag_app.cli.many import end_with, refuse_outputs, sessions_in, work_options, write_table
from draglag_app.parallel import spread

EACH_IN_FULL = 5  # sessions of which each difference is printed; of more, the order alone
COLUMNS = ("session", "rank", "rank_low", "rank_high", "mean_latency_ms", "low_ms", "high_ms")


@dataclass(frozen=True)
class Found:
    """A curve, or why there is none."""

    curve: CurveFit | None = None
    source: Source | None = None
    problem: str = ""
    remedy: str = ""


@click.command("compare")
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--report", type=click.Path(path_type=Path), metavar="FILE.html", help="Write a page with the figures.")
@click.option(
    "--out", type=click.Path(path_type=Path), metavar="TABLE.csv|.parquet", help="Write the order as a table."
)
@work_options
@json_option
def compare(
    sessions: tuple[Path, ...],
    report: Path | None,
    out: Path | None,
    scheduler: str | None,
    jobs: int | None,
    as_json: bool,
) -> None:
    """Fit the curve of every session (session files, exchange folders, folders of them, globs, or models), show how
    each differs from the first, with a 95 % band, and rank them by their mean latency over the speeds all share.

    \b
    Examples:
        draglag compare monday.h5 tuesday.h5 --report difference.html
        draglag compare screens --jobs 8 --out order.csv --report order.html
    """
    paths = sessions_in(sessions)
    if len(paths) < 2:
        raise click.UsageError("Give at least two sessions.")
    refuse_outputs(out)
    if report is not None:
        need("matplotlib")
        refuse_existing(report)
    curves, failed = _curves(paths, jobs, scheduler)
    order, no_order = _order(curves)
    if report is not None:
        from draglag.reproduction.drawings import comparison_page

        with written_whole(report) as growing:
            growing.write_text(comparison_page(curves, order), "utf-8")
    if out is not None:
        write_table([] if order is None else _rows(order), COLUMNS, out)
    differences = _differences(curves)
    if as_json:
        print_json(_result(curves, differences, order, failed))
    else:
        if len(curves) <= EACH_IN_FULL:
            _print_each(curves[0][0], differences)
        if len(curves) > 2:
            click.echo(f"No order: {no_order}" if order is None else _order_table(order))
    end_with(list(failed.values()), len(paths))


def _curves(
    paths: list[Path], jobs: int | None, scheduler: str | None
) -> tuple[list[tuple[str, CurveFit, Source]], dict[str, str]]:
    jobs = jobs or (None if len(paths) > EACH_IN_FULL else 1)  # to start processes takes longer than two sessions
    found: dict[int, Found] = {}
    with progress("Comparing") as report:
        for place, one in spread(curve_of, paths, jobs, scheduler):
            found[place] = one
            if report:
                report(len(found) / len(paths), paths[place].name)
    curves, failed = [], {}
    for place, path in enumerate(paths):
        one = found[place]
        if one.curve is not None and one.source is not None:
            curves.append((str(path), one.curve, one.source))
        else:
            failed[str(path)] = f"{one.problem} {one.remedy}".strip()
    if len(curves) < 2:
        first = next(one for _, one in sorted(found.items()) if one.curve is None)
        raise EstimateError(first.problem, first.remedy)
    return curves, failed


def curve_of(path: Path) -> Found:
    """The curve of a session or model."""
    from draglag.analysis import analyze
    from draglag.model.file import load_model

    try:
        if path.suffix == ".json" and path.name != "session.json":
            model = load_model(path)
            return Found(model.curve, model.source)
        data = load_session(path)
        curve = analyze(data).curve
        if curve is None:
            raise EstimateError(
                message("{path}: there is no curve", path=path), "See draglag analyze for the verdict on its runs"
            )
    except DraglagError as error:
        return Found(problem=error.problem, remedy=error.remedy)
    return Found(curve, source_of(data))


def _differences(curves: list[tuple[str, CurveFit, Source]]) -> list[tuple[str, CurveDifference | None]]:
    from draglag.curve.compare import curve_difference

    first = curves[0][1]
    return [(name, curve_difference(first, curve)) for name, curve, _ in curves[1:]]


def _order(curves: list[tuple[str, CurveFit, Source]]) -> tuple[Ranking | None, str]:
    from draglag.curve.ranking import ranking

    try:
        return ranking([(name, curve) for name, curve, _ in curves]), ""
    except EstimateError as error:
        return None, str(error)


def _rows(order: Ranking) -> list[dict[str, object]]:
    return [
        {
            "session": p.name,
            "rank": p.rank,
            "rank_low": p.rank_low,
            "rank_high": p.rank_high,
            "mean_latency_ms": 1e3 * p.mean_s,
            "low_ms": 1e3 * p.low_s,
            "high_ms": 1e3 * p.high_s,
        }
        for p in order.places
    ]


def _result(
    curves: list[tuple[str, CurveFit, Source]],
    differences: list[tuple[str, CurveDifference | None]],
    order: Ranking | None,
    failed: dict[str, str],
) -> dict[str, object]:
    return {
        "first": curves[0][0],
        "curves": [
            {"session": name, "simulated": source.simulated, **curve.to_dict()} for name, curve, source in curves
        ],
        "differences": [{"session": name, **(d.to_dict() if d else {"at": []})} for name, d in differences],
        "ranking": None if order is None else order.to_dict(),
        "failed": failed,
    }


def _print_each(first: str, differences: list[tuple[str, CurveDifference | None]]) -> None:
    for name, difference in differences:
        if difference is None:
            click.echo(f"{name} and {first} share no speeds.")
            continue
        rows = [
            [number(float(v), 0), number(1e3 * float(d), 2), f"{1e3 * a:.2f} to {1e3 * b:.2f}"]
            for v, d, a, b in zip(
                difference.speed_mm_s, difference.difference_s, difference.low_s, difference.high_s, strict=True
            )
        ]
        word = "they differ" if difference.p_value < 0.05 else "no difference beyond chance"
        click.echo(f"{name} minus {first}: {word} ({chance(difference.p_value)})")
        click.echo(table(["speed mm/s", "difference ms", "95 % band ms"], rows, left=0) + "\n")


def _order_table(order: Ranking) -> str:
    low, high = order.speed_range_mm_s
    rows = [
        [
            p.name,
            str(p.rank),
            f"{p.rank_low} to {p.rank_high}",
            number(1e3 * p.mean_s, 2),
            f"{1e3 * p.low_s:.2f} to {1e3 * p.high_s:.2f}",
        ]
        for p in order.places
    ]
    head = ["session", "rank", "95 %", "mean latency ms", "95 % interval ms"]
    return f"Mean latency from {low:.0f} to {high:.0f} mm/s\n" + table(head, rows)
