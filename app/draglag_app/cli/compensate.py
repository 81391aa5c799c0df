"""``draglag compensate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from draglag.errors import DataError, cause
from draglag.messages import message
from draglag.reading.limits import TIME_S
from draglag.recording import FloatArray
from draglag.system.packages import need
from draglag.system.temporary import new_file
from draglag_app.cli.common import json_option, number, print_json, refuse_existing, table, warn

if TYPE_CHECKING:
    from draglag.gap.correction import Correction
    from draglag.model.compensation import Compensated
    from draglag.model.file import LatencyModel


@click.command("compensate")
@click.argument("model_path", metavar="MODEL.json", type=click.Path(path_type=Path))
@click.argument("source", metavar="[IN.csv", required=False, type=click.Path(path_type=Path))
@click.argument("out", metavar="OUT.csv]", required=False, type=click.Path(path_type=Path))
@click.option("--extrapolate", is_flag=True, help="Follow the curve beyond its measured speeds, not hold its ends.")
@click.option("--lookup", type=click.Path(path_type=Path), help="Also write the model as a table: .csv or MATLAB .mat.")
@click.option("--tracking", is_flag=True, help="Show what the lag does to a tracking task (gain and phase, Table 1).")
@click.option("--figure", type=click.Path(path_type=Path), help="Draw gain and phase into this .svg or .png file.")
@json_option
def compensate(
    model_path: Path,
    source: Path | None,
    out: Path | None,
    extrapolate: bool,
    lookup: Path | None,
    tracking: bool,
    figure: Path | None,
    as_json: bool,
) -> None:
    """Take the drag latency out of recorded touch events. IN.csv has the columns t_s, x_mm, y_mm, and perhaps
    contact_id, whose contacts are taken one by one. OUT.csv repeats the three and adds when the stylus was where the
    event shows it (stylus_t_s, latency_ms), where it was at t_s itself (x_stylus_mm, y_stylus_mm), its speed, and
    whether that speed lies outside the model's range.

    \b
    Examples:
        draglag compensate model.json touch.csv compensated.csv
        draglag compensate model.json --lookup latency.mat --tracking
    """
    from draglag.model.file import left_unexplained, load_model, save_lookup

    if (source is None) != (out is None) or not (source or lookup or tracking or figure):
        raise click.UsageError("Give IN.csv and OUT.csv, or --lookup, --tracking or --figure.")
    if figure is not None:
        need("matplotlib")
    model = load_model(model_path)
    warn(left_unexplained(model))
    result: dict[str, Any] = {"model": str(model_path), "form": model.form}
    if source is not None and out is not None:
        result["compensated"] = _compensated(model, source, out, extrapolate)
    if lookup is not None:
        save_lookup(model, lookup)
        result["lookup"] = str(lookup)
    if tracking or figure:
        from draglag.model.tracking import tracking_response

        response = tracking_response(lambda v: model.latency_s(v, extrapolate=extrapolate))
        result["tracking"] = response.to_dict()
        if figure is not None:
            from draglag.reproduction.drawings import save_tracking

            save_tracking({model.provenance.screen or "model": response}, figure, model.source)
            result["figure"] = str(figure)
    if as_json:
        print_json(result)
    else:
        click.echo("\n\n".join(_words(result, out)))


def _compensated(model: LatencyModel, source: Path, out: Path, extrapolate: bool) -> dict[str, Any]:
    refuse_existing(out)
    t_s, x_mm, y_mm, contact = _read(source)
    try:
        done, correction = _of_contacts(t_s, x_mm, y_mm, contact, model, extrapolate)
    except DataError as error:
        raise DataError(message("{source}: {problem}", source=source, problem=error.problem), error.remedy) from error
    columns = {
        "t_s": t_s,
        "x_mm": x_mm,
        "y_mm": y_mm,
        "stylus_t_s": done.stylus_t_s,
        "latency_ms": 1e3 * (t_s - done.stylus_t_s),
        "x_stylus_mm": done.x_stylus_mm,
        "y_stylus_mm": done.y_stylus_mm,
        "speed_mm_s": done.speed_mm_s,
        "extrapolated": done.extrapolated.astype(float),
    }
    form = ["%.6f", "%.4f", "%.4f", "%.6f", "%.4f", "%.4f", "%.4f", "%.2f", "%d"]
    try:
        rows = np.column_stack(list(columns.values()))
        with new_file(out) as growing:
            np.savetxt(growing, rows, delimiter=",", header=",".join(columns), comments="", fmt=form)
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=out, why=cause(error)), "Check the folder and free space"
        ) from error
    return {
        **done.report(),
        "not_compensated": list(correction.left_but_law),
        **correction.to_dict(),
        "words": correction.words(),
    }


def _of_contacts(
    t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray, contact: FloatArray, model: LatencyModel, extrapolate: bool
) -> tuple[Compensated, Correction]:
    """Each contact by itself; NaN for those too short. Raises DataError where all are."""
    from draglag.gap.correction import corrected_touch
    from draglag.gap.correction import merged as all_corrections
    from draglag.model.compensation import compensate as apply
    from draglag.model.compensation import merged

    def law(v: FloatArray) -> FloatArray:
        return model.latency_s(v, extrapolate=extrapolate)

    parts: list[tuple[np.ndarray, Compensated]] = []
    corrections: list[Correction] = []
    trouble: DataError | None = None
    order = np.argsort(contact, kind="stable")
    for which in np.split(order, np.flatnonzero(np.diff(contact[order])) + 1):
        t, x, y, correction = corrected_touch(t_s[which], x_mm[which], y_mm[which], model)
        try:
            parts.append((which, apply(t, x, y, law, model.speed_range_mm_s)))
            corrections.append(correction)
        except DataError as error:
            trouble = trouble or error
    if trouble is not None and not parts:
        raise trouble
    return merged(t_s, parts), all_corrections(corrections)


def _read(path: Path) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Times, positions, and the numbers of the contacts: -1 where there is none."""
    from draglag.exchange.tables import read_events

    rows = read_events(path, ("t_s", "x_mm", "y_mm"), perhaps=("contact_id",))
    if not len(rows):
        raise DataError(message("{path}: holds no events", path=path), "Give one row t_s,x_mm,y_mm for each event")
    if np.nanmax(np.abs(rows[:, 0]), initial=0.0, where=np.isfinite(rows[:, 0])) > TIME_S:
        raise DataError(
            message("{path}: t_s holds times that cannot be seconds", path=path), "Give the times in seconds"
        )
    return rows[:, 0], rows[:, 1], rows[:, 2], np.where(np.isnan(rows[:, 3]), -1.0, rows[:, 3])


def _words(result: dict[str, Any], out: Path | None) -> list[str]:
    blocks = []
    if "compensated" in result:
        done = result["compensated"]
        latency, moved = done["latency_ms_min_median_max"], done["moved_mm_min_median_max"]
        lines = [f"{out}: {done['n_retimed']} of {done['n_events']} events re-timed, {done['n_placed']} placed"]
        if latency:
            lines.append(f"  latency {latency[0]:.1f} to {latency[2]:.1f} ms, median {latency[1]:.1f} ms")
        if moved:
            lines.append(
                f"  moved by up to {moved[2]:.1f} mm, median {moved[1]:.1f} mm, RMS {done['moved_rms_mm']:.1f} mm"
            )
        if done["n_extrapolated"]:
            lines.append(f"  {done['n_extrapolated']} at speeds the model was not measured at: marked 'extrapolated'")
        if done["words"]:
            lines.append(f"  {done['words']}")
        blocks.append("\n".join(lines))
    if "lookup" in result:
        blocks.append(f"{result['lookup']}: speed_mm_s, latency_s and its 95 % band")
    if "tracking" in result:
        blocks.append(_tracking_table(result["tracking"]))
    return blocks


def _tracking_table(response: list[dict[str, float]]) -> str:
    head = ["rad/s", "amplitude mm", "gain", "phase °", "delay ms"]
    digits = {"frequency_rad_s": 3, "amplitude_mm": 2, "gain": 3, "phase_deg": 1, "delay_ms": 1}
    rows = [[number(row[name], n) for name, n in digits.items()] for row in response]
    return "Tracking the multi-sine of Table 1 through this screen\n" + table(head, rows, left=0)
