"""The neutral exchange folder."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from draglag.errors import DataError, cause
from draglag.exchange.extras import (
    entries,
    find_pair,
    read_clocks,
    run_extras,
    run_keys,
    session_extras,
    write_run_extras,
    write_session_extras,
)
from draglag.exchange.header import FORMAT, VERSION, HeaderPart, RunPart, read_header
from draglag.exchange.results import write_results
from draglag.exchange.streams import read_laser, read_taps, read_touch
from draglag.exchange.tables import write_table
from draglag.messages import message
from draglag.reading.contacts import at_once
from draglag.reading.limits import HEADER_BYTES
from draglag.reading.off_screen import off_screen
from draglag.recording import LogEntry, Run, Screen, Session, Stylus, Taps
from draglag.store.analysis import StoredAnalysis
from draglag.store.schema import check_run_id
from draglag.system.temporary import temporary_for

# A lab may start its recorder a little early or stop it late; beyond this, its times are on another clock.
_SLACK_S = 5.0


def session_folder(path: Path) -> Path:
    """The exchange folder that a folder, or its ``session.json``, stands for. Raises DataError where it is none."""
    folder = path if path.is_dir() else path.parent
    if folder.is_dir() and not (folder / "session.json").exists():
        raise DataError(
            message("{path}: holds no session", path=path),
            "Name a session file (.h5), or a folder that holds session.json",
        )
    return folder


def read_exchange(folder: Path | str) -> Session:
    """The session of a folder, all times on one host clock, not relative to the run.

    Unsound rows are left out and reported in the run's log and the session's notes. Raises DataError: no or malformed
    session.json, malformed CSV, two runs of one id, no run with any data.
    """
    folder = Path(folder)
    header = read_header(folder / "session.json")
    runs: list[Run] = []
    ids: set[str] = set()
    for part in header.runs:
        check_run_id(part.id, f"{folder / 'session.json'}")
        if part.id in ids:
            raise DataError(
                message("{path}: there are two runs “{run}”", path=folder / "session.json", run=part.id),
                "Rename one of them",
            )
        ids.add(part.id)
        runs.append(_run(folder, part))
    if not any(len(run.touch.t_s) or len(run.laser.t_s) for run in runs):
        raise DataError(
            message("{path}: holds no data of any run", path=folder),
            "Expected <id>.touch.csv and <id>.laser.csv (or .csv.gz) for every run in session.json",
        )
    taps, said = _taps(folder, header)
    panel = header.screen
    screen = Screen(panel.name, panel.width_mm, panel.height_mm, panel.width_px, panel.height_px)
    said += off_screen(screen, runs)
    notes = list(entries(header.notes))
    imported = [entry for run in runs for entry in run.log if entry.source == "import"]
    imported += [LogEntry(0.0, "warning", "import", text) for text in said]
    known = set(notes)
    notes += [entry for entry in imported if entry not in known]
    return Session(
        name=header.name or folder.resolve().name,
        screen=screen,
        stylus=Stylus(header.stylus_diameter_mm, header.stylus_name),
        runs=tuple(runs),
        taps=taps,
        clock=header.clock,
        notes=tuple(notes),
        **session_extras(folder, header),
    )


def _run(folder: Path, part: RunPart) -> Run:
    touch, said = read_touch(*find_pair(folder, part.id, "touch"), part.as_recorded)
    laser, more = read_laser(*find_pair(folder, part.id, "laser"), part.as_recorded)
    said += more
    touch, laser, display, more = run_extras(folder, part, touch, laser)
    said += [*more, *at_once(touch)]
    times = np.concatenate([touch.t_s, laser.t_s])
    start_s, duration_s = part.start_s, part.duration_s
    if start_s is None:
        start_s = float(times.min()) if len(times) else 0.0
    if duration_s is None:
        duration_s = max(float(times.max()) - start_s, 0.0) if len(times) else 0.0
    outside = (times < start_s - _SLACK_S) | (times > start_s + duration_s + _SLACK_S)
    if outside.any():
        said.append(
            message(
                "{n} samples lie outside the run's {start_s:g} to {end_s:g} s: all times must be on one host "
                "clock, not relative to the run",
                n=int(outside.sum()),
                start_s=start_s,
                end_s=start_s + duration_s,
            )
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
        display=display,
        sync=read_clocks(folder, part.sync),
        log=_log(part, start_s, said),
        seed=part.seed,
    )


def _log(part: RunPart, start_s: float, said: list[str]) -> tuple[LogEntry, ...]:
    log = entries(part.log)
    new = [LogEntry(start_s, "warning", "import", message("{run}: {text}", run=part.id, text=text)) for text in said]
    return (*log, *(entry for entry in new if entry not in log))


def _taps(folder: Path, header: HeaderPart) -> tuple[Taps | None, list[str]]:
    if header.taps is None:
        return None, []
    taps, said = read_taps(folder / header.taps)
    return replace(taps, rejected=header.taps_rejected), said


def write_exchange(
    session: Session, folder: Path | str, compress: bool = True, results: Sequence[StoredAnalysis] = ()
) -> Path:
    """The folder written. Raises DataError where it exists and is not empty."""
    folder = Path(folder)
    end = ".csv.gz" if compress else ".csv"
    with new_folder(folder) as place:
        for run in session.runs:
            check_run_id(run.id, session.name)
            touch, laser = run.touch, run.laser
            write_table(place / f"{run.id}.touch{end}", {"t_s": touch.t_s, "x_mm": touch.x_mm, "y_mm": touch.y_mm})
            write_table(place / f"{run.id}.laser{end}", {"t_s": laser.t_s, "light": laser.light})
            write_run_extras(place, run, end)
        if session.taps is not None:
            taps = session.taps
            columns = {"physical_s": taps.physical_s, "registered_s": taps.registered_s, "down": taps.down}
            write_table(place / f"taps{end}", columns)
        header = _header(session, f"taps{end}" if session.taps is not None else None)
        header |= write_session_extras(place, session, end)
        header["runs"] = [_run_header(run, end) for run in session.runs]
        write_results(place, results)
        (place / "session.json").write_bytes(_header_bytes(header, folder))
    return folder


def _header_bytes(header: dict[str, Any], folder: Path) -> bytes:
    try:
        data = (json.dumps(header, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8", "replace")
    except ValueError as error:
        raise DataError(
            message("{path}: a value of the session is not a finite number", path=folder), "Run draglag verify"
        ) from error
    if len(data) > HEADER_BYTES:
        raise DataError(
            message(
                "{path}: logs and notes need more than {most} MiB in session.json",
                path=folder,
                most=HEADER_BYTES // 2**20,
            ),
            "Export to netcdf",
        )
    return data


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Yields a folder that gets its name once whole. Raises DataError."""
    # "/" and "." have no name of their own.
    if not folder.name or (folder.exists() and (not folder.is_dir() or any(folder.iterdir()))):
        raise DataError(message("{path}: exists already and is not overwritten", path=folder), "Choose another name")
    made = False
    try:
        with temporary_for(folder) as growing:
            growing.mkdir()
            made = True
            yield growing
            growing.rename(folder)
    except OSError as error:
        problem = message(
            "{path}: cannot be written ({why})" if made else "{path}: cannot be made ({why})",
            path=folder,
            why=cause(error),
        )
        raise DataError(problem, "Check free space" if made else "Choose another place") from error


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
        "taps": taps,
    }


def _run_header(run: Run, end: str) -> dict[str, Any]:
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
    return header | run_keys(run, end)
