"""``draglag compensate``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from draglag.errors import DataError, cause
from draglag.messages import Message, message
from draglag.recording import FloatArray, IntArray
from draglag.system.packages import need
from draglag.system.temporary import new_file
from draglag_app.cli.common import FiniteRange, json_option, number, print_json, refuse_existing, table, warn

if TYPE_CHECKING:
    from draglag.exchange.importers.columns import ColumnMap
    from draglag.model.compensation import Compensated
    from draglag.model.file import LatencyModel

_KEYS = ("t", "x", "y", "contact", "clock")  # of --map
_CONTACT = "contact_id"
_LIKELY_CONTACT = re.compile("contact|finger|pointer|slot|track|touch_?id", re.IGNORECASE)


@click.command("compensate")
@click.argument("model_path", metavar="MODEL.json", type=click.Path(path_type=Path))
@click.argument("source", metavar="[IN.csv", required=False, type=click.Path(path_type=Path))
@click.argument("out", metavar="OUT.csv]", required=False, type=click.Path(path_type=Path))
@click.option("--extrapolate", is_flag=True, help="Follow the curve beyond its measured speeds, not hold its ends.")
@click.option("--lookup", type=click.Path(path_type=Path), help="Also write the model as a table: .csv or MATLAB .mat.")
@click.option("--tracking", is_flag=True, help="Show what the lag does to a tracking task (gain and phase, Table 1).")
@click.option("--figure", type=click.Path(path_type=Path), help="Draw gain and phase into this .svg or .png file.")
@click.option(
    "--map",
    "mapped",
    multiple=True,
    metavar="KEY=COLUMN[:UNIT]",
    help="Columns and units of IN.csv as in draglag import: t, x, y, contact; clock=SECONDS; may be repeated.",
)
@click.option("--screen", metavar="NAME", help="Preset or TOML file of the screen, for positions in pixels.")
@click.option("--units-per-mm", type=FiniteRange(min=0, min_open=True), metavar="N", help="For positions in raw units.")
@json_option
def compensate(
    model_path: Path,
    source: Path | None,
    out: Path | None,
    extrapolate: bool,
    lookup: Path | None,
    tracking: bool,
    figure: Path | None,
    mapped: tuple[str, ...],
    screen: str | None,
    units_per_mm: float | None,
    as_json: bool,
) -> None:
    """Take the drag latency out of recorded touch events. IN.csv has the columns t_s, x_mm, y_mm, and perhaps
    contact_id (numbers or texts), whose contacts are taken one by one; --map names others. OUT.csv repeats the three
    in s and mm and adds when the stylus was where the event shows it (stylus_t_s, latency_ms), where it was at t_s
    itself (x_stylus_mm, y_stylus_mm), its speed, and whether that speed lies outside the model's range. The last events
    of each contact, about one latency, have no place of the stylus (nan): the events that would show it were not
    recorded, as the contact had ended.

    \b
    Examples:
        draglag compensate model.json touch.csv compensated.csv
        draglag compensate model.json log.csv out.csv --map t=stamp:ms --map x=posX:cm --map y=posY:cm \\
            --map contact=finger
        draglag compensate model.json --lookup latency.mat --tracking
    """
    from draglag.model.file import left_unexplained, load_model, save_lookup

    if (source is None) != (out is None) or not (source or lookup or tracking or figure):
        raise click.UsageError("Give IN.csv and OUT.csv, or --lookup, --tracking or --figure.")
    if source is None and (mapped or screen or units_per_mm):
        raise click.UsageError("--map, --screen and --units-per-mm are of IN.csv: give it, and OUT.csv.")
    if figure is not None:
        need("matplotlib")
    model = load_model(model_path)
    warn(left_unexplained(model))
    result: dict[str, Any] = {"model": str(model_path), "form": model.form}
    if source is not None and out is not None:
        refuse_existing(out)
        read = _read(source, mapped, screen, units_per_mm)
        result["compensated"] = _compensated(model, source, out, extrapolate, read)
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


def _compensated(
    model: LatencyModel, source: Path, out: Path, extrapolate: bool, read: tuple[FloatArray, IntArray | None, ColumnMap]
) -> dict[str, Any]:
    from draglag.gap.compensating import Origin, compensate_events

    rows, contact, how = read
    time = how.names(("t",), {"t": ("t_s", "s")})["t"][0]
    origin = Origin(
        source.name,
        message("Give the unit of the time, as in --map t={column}:ms", column=time),
        message("Give the unit of the positions, as in --map x=COLUMN:m --map y=COLUMN:m"),
        _contact_remedy(source, how, contact is not None),
    )
    t_s, x_mm, y_mm = np.ascontiguousarray(rows.T)
    try:
        events = compensate_events(t_s, x_mm, y_mm, model, contact, extrapolate=extrapolate, origin=origin)
    except DataError as error:
        raise DataError(message("{source}: {problem}", source=source, problem=error.problem), error.remedy) from error
    warn(*events.warnings)
    done, correction = events.done, events.correction
    _write(out, done, x_mm, y_mm)
    return {
        **done.report(),
        "not_compensated": list(correction.left_but_law),
        **correction.to_dict(),
        "words": correction.words(),
        "warnings": list(events.warnings),
    }


def _write(out: Path, done: Compensated, x_mm: FloatArray, y_mm: FloatArray) -> None:
    columns = {
        "t_s": done.t_s,
        "x_mm": x_mm,
        "y_mm": y_mm,
        "stylus_t_s": done.stylus_t_s,
        "latency_ms": 1e3 * done.latency_s,
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


def _read(
    path: Path, mapped: tuple[str, ...], screen: str | None, units_per_mm: float | None
) -> tuple[FloatArray, IntArray | None, ColumnMap]:
    """Times and positions (n, 3), s and mm; numbers of the contacts (n,), None without a column of them; the map."""
    from draglag.exchange.importers.columns import parse_map, read_contacts, read_positions
    from draglag.exchange.tables import event_columns
    from draglag.protocol.presets import load_screen

    how = parse_map(mapped)
    other = [key for key in (*how.columns, *how.shift_s, *how.streams) if key not in _KEYS]
    if other:
        raise DataError(
            message("--map {key}=…: compensation does not use it", key=other[0]),
            message("Keys are {known}", known=", ".join(_KEYS)),
        )
    rows = read_positions(path, how, None if screen is None else load_screen(screen), units_per_mm)
    if not len(rows):
        raise DataError(message("{path}: holds no events", path=path), "Give one row t_s,x_mm,y_mm for each event")
    if "contact" not in how.columns and _CONTACT not in event_columns(path):
        return rows, None, how
    return rows, read_contacts(path, how.columns.get("contact", (_CONTACT, ""))[0]), how


def _contact_remedy(path: Path, how: ColumnMap, named: bool) -> Message:
    from draglag.exchange.tables import event_columns

    used = {column for column, _ in how.columns.values()} | {_CONTACT}
    likely = [] if named else [c for c in event_columns(path) if c not in used and _LIKELY_CONTACT.search(c)]
    if likely:
        return message("Name the column of the contact, perhaps --map contact={column}", column=likely[0])
    return message("Name the column of the contact, as in --map contact=COLUMN")


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
