"""Optional files and keys of an exchange folder (docs/exchange.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from draglag.errors import DataError
from draglag.exchange.header import CalibrationPart, ClockPart, EntryPart, HeaderPart, RunPart
from draglag.exchange.streams import LASER_MORE, TOUCH_MORE, read_display, read_gaps, whole
from draglag.exchange.tables import column_names, find_table, read_table, write_table
from draglag.messages import message
from draglag.provenance import SIMULATED, is_simulated
from draglag.reading import read_text
from draglag.reading.limits import HEADER_BYTES, TIME_S
from draglag.recording import (
    AxisInfo,
    Beam,
    ClockBounds,
    DisplayTrace,
    FloatArray,
    LaserTrace,
    LogEntry,
    Run,
    Session,
    TouchCalibration,
    TouchTrace,
)

PROTOCOL_FILE = "protocol.toml"
_CLOCK = ("device_s", "host_min_s", "host_max_s")


def find_pair(folder: Path, run_id: str, stream: str) -> tuple[Path | None, Path | None]:
    """Files of a stream and of its further columns. Raises DataError."""
    return find_table(folder, f"{run_id}.{stream}"), find_table(folder, f"{run_id}.{stream}-more")


def write_run_extras(place: Path, run: Run, end: str) -> None:
    """Write a run's optional files, except empty ones."""
    for name, trace, columns in (("touch", run.touch, TOUCH_MORE), ("laser", run.laser, LASER_MORE)):
        known = {column: getattr(trace, column) for column in columns if len(getattr(trace, column))}
        if known:
            write_table(place / f"{run.id}.{name}-more{end}", {"t_s": trace.t_s, **known})
        if len(trace.gaps_s):
            gaps = {"start_s": trace.gaps_s[:, 0], "end_s": trace.gaps_s[:, 1]}
            write_table(place / f"{run.id}.{name}-gaps{end}", gaps)
    if run.display is not None:
        shown = run.display
        write_table(place / f"{run.id}.display{end}", {"t_s": shown.t_s, "x_mm": shown.x_mm, "y_mm": shown.y_mm})
    for number, bounds in enumerate(run.sync, 1):
        _write_clock(place / f"{run.id}.clock-{number}{end}", bounds)


def run_keys(run: Run, end: str) -> dict[str, Any]:
    """Optional keys of a run in session.json."""
    keys = {
        "as_recorded": True,
        "touch_dropped": run.touch.dropped,
        "touch_axes": [asdict(axis) for axis in run.touch.axes],
        "display_missed": 0 if run.display is None else run.display.missed,
        "sync": _clock_keys(run.sync, f"{run.id}.clock", end),
        "log": [asdict(entry) for entry in run.log],
    }
    kept = {key: value for key, value in keys.items() if value}
    return {**kept, "laser_missed": run.laser.missed} | ({} if run.seed is None else {"seed": run.seed})


def write_session_extras(place: Path, session: Session, end: str) -> dict[str, Any]:
    """Optional keys of session.json, whose files are written."""
    for number, bounds in enumerate(session.clocks, 1):
        _write_clock(place / f"clock-{number}{end}", bounds)
    if session.protocol_toml:
        (place / PROTOCOL_FILE).write_bytes(session.protocol_toml.encode("utf-8", "replace"))
    calibration = None
    if session.calibration is not None:
        calibration = {
            key: value.tolist() if isinstance(value, np.ndarray) else value
            for key, value in vars(session.calibration).items()
        }
    keys: dict[str, Any] = {
        "stylus_name": session.stylus.name,
        "started_utc": session.started_utc,
        "software": session.software,
        SIMULATED: is_simulated(session.devices),
        "devices": dict(session.devices),
        "details": dict(session.details),
        "beam": None if session.beam is None else asdict(session.beam),
        "calibration": calibration,
        "clocks": _clock_keys(session.clocks, "clock", end),
        "protocol_file": PROTOCOL_FILE if session.protocol_toml else None,
        "taps_rejected": {} if session.taps is None else dict(session.taps.rejected),
        "notes": [asdict(entry) for entry in session.notes],
    }
    given = {"started_s": session.started_s, "seed": session.seed}
    return {key: value for key, value in keys.items() if value} | {
        key: value for key, value in given.items() if value is not None
    }


def session_extras(folder: Path, header: HeaderPart) -> dict[str, Any]:
    """Optional fields of a ``Session``. Raises DataError."""
    devices = dict(header.devices)
    if header.simulated and not is_simulated(devices):
        devices[SIMULATED] = "session.json says so"
    beam, known = header.beam, header.calibration
    return {
        "beam": None if beam is None else Beam(beam.slope, beam.intercept_mm),
        "clocks": read_clocks(folder, header.clocks),
        "started_utc": header.started_utc,
        "started_s": header.started_s,
        "protocol_toml": _protocol(folder, header),
        "seed": header.seed,
        "devices": devices,
        "details": dict(header.details),
        "software": header.software,
        "calibration": None if known is None else _calibration(known),
    }


def run_extras(
    folder: Path, part: RunPart, touch: TouchTrace, laser: LaserTrace
) -> tuple[TouchTrace, LaserTrace, DisplayTrace | None, list[str]]:
    """Traces with gaps, counts and axes; what was displayed; corrections made."""
    axes = tuple(AxisInfo(a.name, a.minimum, a.maximum, a.resolution, a.fuzz) for a in part.touch_axes)
    touch = replace(touch, gaps_s=_gaps(folder, f"{part.id}.touch"), dropped=part.touch_dropped, axes=axes)
    missed = laser.missed if part.laser_missed is None else part.laser_missed
    laser = replace(laser, gaps_s=_gaps(folder, f"{part.id}.laser"), missed=missed)
    path = find_table(folder, f"{part.id}.display")
    if path is None:
        return touch, laser, None, []
    return touch, laser, *read_display(path, part.display_missed)


def read_clocks(folder: Path, parts: Sequence[ClockPart]) -> tuple[ClockBounds, ...]:
    """One ``ClockBounds`` per stream. Raises DataError for reversed bounds."""
    return tuple(_clock(folder / part.file, part.stream) for part in parts)


def entries(parts: Sequence[EntryPart]) -> tuple[LogEntry, ...]:
    """Log entries of session.json."""
    return tuple(LogEntry(part.t_s, part.level, part.source, part.text) for part in parts)


def _calibration(known: CalibrationPart) -> TouchCalibration:
    return TouchCalibration(
        np.array(known.x_raw, float),
        np.array(known.y_raw, float),
        np.array(known.x_mm, float),
        np.array(known.y_mm, float),
        np.array(known.matrix, float),
        known.device,
        known.made_utc,
    )


def _clock(path: Path, stream: str) -> ClockBounds:
    names = [*_CLOCK, "epoch"] if "epoch" in column_names(path) else list(_CLOCK)
    columns = [np.ascontiguousarray(column) for column in read_table(path, names).T]
    device_s, host_min_s, host_max_s = columns[:3]
    if not (np.abs(device_s) <= TIME_S).all() or not (host_min_s <= host_max_s).all():
        raise DataError(
            message("{path}: expected finite device_s and host_min_s no later than host_max_s", path=path),
            "Correct or remove those rows",
        )
    epoch = whole(path, "epoch", columns[3]) if len(columns) > 3 else np.empty(0, np.int64)
    return ClockBounds(stream, device_s, host_min_s, host_max_s, epoch)


def _gaps(folder: Path, stem: str) -> FloatArray:
    path = find_table(folder, f"{stem}-gaps")
    if path is None:
        return np.empty((0, 2))
    return read_gaps(path)


def _protocol(folder: Path, header: HeaderPart) -> str:
    if header.protocol_file is None:
        return ""
    return read_text(folder / header.protocol_file, HEADER_BYTES, message("Remove the key protocol_file"))


def _write_clock(path: Path, bounds: ClockBounds) -> None:
    columns = {name: getattr(bounds, name) for name in _CLOCK}
    write_table(path, columns | ({"epoch": bounds.epoch} if len(bounds.epoch) else {}))


def _clock_keys(clocks: Sequence[ClockBounds], stem: str, end: str) -> list[dict[str, str]]:
    return [{"stream": bounds.stream, "file": f"{stem}-{number}{end}"} for number, bounds in enumerate(clocks, 1)]
