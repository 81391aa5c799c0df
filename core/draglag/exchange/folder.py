"""The neutral exchange folder (the design, section 7), read and written.

All times in it are absolute: ``t_s`` of touch and laser, the taps and every ``start_s`` are seconds on one and the
same host clock, as they are in a ``Session``. A run's samples therefore begin near its ``start_s``, not near zero.
"""

from __future__ import annotations

import json
import shutil
import uuid
from pathlib import Path
from typing import Any

import numpy as np

from draglag.errors import DataError
from draglag.exchange.header import FORMAT, VERSION, HeaderPart, RunPart, read_header
from draglag.exchange.streams import read_laser, read_taps, read_touch
from draglag.exchange.tables import find_table, write_table
from draglag.recording import LaserTrace, LogEntry, Run, Screen, Session, Stylus, Taps, TouchTrace
from draglag.store.schema import check_run_id

# A lab may start its recorder a little early or stop it late; beyond this, its times are on another clock.
_SLACK_S = 5.0


def read_exchange(folder: Path | str) -> Session:
    """A session from an exchange folder, on the host clock of its files.

    What is not sound is left out and said: in the log of the run it concerns (level "warning", source "import") and
    in the session's notes.

    Raises DataError, naming file, line or key and what was expected: no or malformed session.json, malformed CSV,
    two runs of one id, no run with any data.
    """
    folder = Path(folder)
    header = read_header(folder / "session.json")
    notes: list[LogEntry] = []
    runs: list[Run] = []
    for part in header.runs:
        check_run_id(part.id, f"{folder / 'session.json'}")
        if any(run.id == part.id for run in runs):
            raise DataError(f"{folder / 'session.json'}: there are two runs “{part.id}”", "Rename one of them")
        runs.append(_run(folder, part))
    notes += [entry for run in runs for entry in run.log]
    if not any(len(run.touch.t_s) or len(run.laser.t_s) for run in runs):
        raise DataError(
            f"{folder}: holds no data of any run",
            "Expected <id>.touch.csv and <id>.laser.csv (or .csv.gz) for every run in session.json",
        )
    taps, said = _taps(folder, header)
    notes += [LogEntry(0.0, "warning", "import", text) for text in said]
    screen = header.screen
    return Session(
        name=header.name or folder.resolve().name,
        screen=Screen(screen.name, screen.width_mm, screen.height_mm, screen.width_px, screen.height_px),
        stylus=Stylus(header.stylus_diameter_mm),
        runs=tuple(runs),
        taps=taps,
        clock=header.clock,
        notes=tuple(notes),
    )


def _run(folder: Path, part: RunPart) -> Run:
    touch, said = read_touch(find_table(folder, f"{part.id}.touch"))
    laser, more = read_laser(find_table(folder, f"{part.id}.laser"))
    said += more
    times = np.concatenate([touch.t_s, laser.t_s])
    start_s, duration_s = part.start_s, part.duration_s
    if start_s is None:
        start_s = float(times.min()) if len(times) else 0.0
    if duration_s is None:
        duration_s = max(float(times.max()) - start_s, 0.0) if len(times) else 0.0
    outside = (times < start_s - _SLACK_S) | (times > start_s + duration_s + _SLACK_S)
    if outside.any():
        said.append(
            f"{int(outside.sum())} samples lie outside the run's {start_s:g} to {start_s + duration_s:g} s: all "
            "times must be on one host clock, not relative to the run"
        )
    return Run(
        id=part.id,
        protocol=part.protocol,
        start_s=start_s,
        duration_s=duration_s,
        touch=touch,
        laser=laser,
        nominal_speed_mm_s=part.nominal_speed_mm_s,
        radius_mm=part.radius_mm,
        target=part.target,
        outcome=part.outcome,
        log=tuple(LogEntry(start_s, "warning", "import", f"{part.id}: {text}") for text in said),
    )


def _taps(folder: Path, header: HeaderPart) -> tuple[Taps | None, list[str]]:
    return read_taps(folder / header.taps) if header.taps is not None else (None, [])


def write_exchange(session: Session, folder: Path | str, compress: bool = True) -> Path:
    """Write a session as an exchange folder; with ``compress``, its CSV files are gzipped.

    What the format has no place for stays behind: raw device values, device clocks, contact ids, logs, display.
    Raises DataError where the folder exists and is not empty, or cannot be written.
    """
    folder = Path(folder)
    end = ".csv.gz" if compress else ".csv"
    with new_folder(folder) as place:
        for run in session.runs:
            check_run_id(run.id, session.name)
            _write_touch(place / f"{run.id}.touch{end}", run.touch)
            _write_laser(place / f"{run.id}.laser{end}", run.laser)
        if session.taps is not None:
            taps = session.taps
            columns = {"physical_s": taps.physical_s, "registered_s": taps.registered_s, "down": taps.down}
            write_table(place / f"taps{end}", columns)
        header = _header(session, f"taps{end}" if session.taps is not None else None)
        text = json.dumps(header, indent=1, ensure_ascii=False, allow_nan=False)
        (place / "session.json").write_text(text + "\n", "utf-8")
    return folder


class new_folder:
    """A folder that appears under its name only when everything in it is written.

    Raises DataError where it exists and is not empty, or cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._growing = folder.with_name(f".{folder.name}.{uuid.uuid4().hex[:8]}")

    def __enter__(self) -> Path:
        if self.folder.exists() and (not self.folder.is_dir() or any(self.folder.iterdir())):
            raise DataError(f"{self.folder}: exists already and is not overwritten", "Choose another name")
        try:
            self._growing.mkdir()
        except OSError as error:
            raise DataError(f"{self.folder}: cannot be made ({error.strerror})", "Choose another place") from error
        return self._growing

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        try:
            if kind is None:
                self._growing.rename(self.folder)
        except OSError as trouble:
            raise DataError(f"{self.folder}: cannot be made ({trouble.strerror})", "Choose another place") from trouble
        finally:
            shutil.rmtree(self._growing, ignore_errors=True)
        if isinstance(error, OSError):
            raise DataError(f"{self.folder}: cannot be written ({error.strerror})", "Check free space") from error


def _header(session: Session, taps: str | None) -> dict[str, Any]:
    screen = session.screen
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": session.name,
        "screen": {
            "name": screen.name,
            "width_mm": screen.width_mm,
            "height_mm": screen.height_mm,
            "width_px": screen.width_px,
            "height_px": screen.height_px,
        },
        "stylus_diameter_mm": session.stylus.diameter_mm,
        "clock": session.clock,
        "runs": [_run_header(run) for run in session.runs],
        "taps": taps,
    }


def _run_header(run: Run) -> dict[str, Any]:
    header: dict[str, Any] = {
        "id": run.id,
        "protocol": run.protocol,
        "nominal_speed_mm_s": run.nominal_speed_mm_s,
        "radius_mm": run.radius_mm,
        "duration_s": run.duration_s,
        "start_s": run.start_s,
    }
    if run.target:
        header["target"] = dict(run.target)
    if run.outcome != "complete":
        header["outcome"] = run.outcome
    return header


def _write_touch(path: Path, touch: TouchTrace) -> None:
    write_table(path, {"t_s": touch.t_s, "x_mm": touch.x_mm, "y_mm": touch.y_mm})


def _write_laser(path: Path, laser: LaserTrace) -> None:
    write_table(path, {"t_s": laser.t_s, "light": laser.light})
