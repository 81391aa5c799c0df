"""Session files read: a reader per schema version."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import (
    AxisInfo,
    Beam,
    ClockBounds,
    DisplayTrace,
    FloatArray,
    LaserTrace,
    LogEntry,
    Run,
    Screen,
    Session,
    Stylus,
    Taps,
    TouchCalibration,
    TouchTrace,
)
from draglag.store import schema
from draglag.store.checksum import raw_checksum
from draglag.store.journal import in_memory, is_journal, open_journal
from draglag.store.safely import (
    check_schema,
    float_attr,
    int_attr,
    named_errors,
    open_session,
    read_attr,
    read_columns,
    text_attr,
)
from draglag.store.sense import check_times
from draglag.store.state import FileState, file_identity
from draglag.store.stored import stored_columns

Columns = Callable[[Any, schema.Table], dict[str, Any]]
"""Reads the columns of a stream: ``read_columns`` at once, ``stored_columns`` on demand."""

CHANGED = message(
    "The raw data were changed after recording: the checksum of the file does not match. Use an untouched copy."
)


def read_session(path: Path | str) -> Session:
    """The raw data of a session file or journal; a warning in the notes marks data changed after recording.

    Raises DataError: no such file, not a session, damaged, links out of the file, a future version, impossible times.
    """
    return read_with_state(path)[0]


def read_with_state(path: Path | str) -> tuple[Session, FileState]:
    """As ``read_session``, and the state of the file that was read."""
    path = Path(path)
    identity = file_identity(path)  # before it is opened: a file that takes its place meanwhile is another one
    with open_recorded(path) as file:
        session, checksum = _checked(file, path, read_columns)
        return session, FileState(identity, checksum)


@contextmanager
def open_columns(path: Path | str) -> Iterator[Session]:
    """Yields the session as ``read_session``, with touch, laser and display columns read on demand."""
    path = Path(path)
    with open_recorded(path) as file:
        yield _checked(file, path, stored_columns)[0]


def _checked(file: Any, path: Path, columns: Columns) -> tuple[Session, str]:
    session = check_times(READERS[check_schema(file, path)](file, columns), str(path))
    checksum = raw_checksum(file)
    if text_attr(file, "raw_sha256", "") not in ("", checksum):
        changed = LogEntry(session.started_s or 0.0, "warning", "file", CHANGED)
        session = replace(session, notes=(*session.notes, changed))
    return session, checksum


def read_unchecked(path: Path | str) -> Session:
    """As ``read_session``, whatever times and checksum are."""
    path = Path(path)
    with open_recorded(path) as file:
        return READERS[check_schema(file, path)](file)


@contextmanager
def open_recorded(path: Path) -> Iterator[Any]:
    """Yields the open session file, or a journal's session in memory."""
    if not is_journal(path):
        with open_session(path) as file:
            yield file
        return
    with open_journal(path) as fd, named_errors(path), in_memory(fd, str(path)) as file:
        yield file


def read_layout(file: Any, columns: Columns = read_columns) -> Session:
    """The session of a checked file of schema 1 or 2."""
    return session_of(file, tuple(run_of(group, columns) for group in _children(file, "runs")))


def session_of(file: Any, runs: tuple[Run, ...]) -> Session:
    """The session with ``runs``, sorted by start."""
    screen, stylus = _group(file, "screen"), _group(file, "stylus")
    beam = file.get("beam")
    return Session(
        name=text_attr(file, "name"),
        screen=Screen(
            text_attr(screen, "name"),
            float_attr(screen, "width_mm"),
            float_attr(screen, "height_mm"),
            int_attr(screen, "width_px"),
            int_attr(screen, "height_px"),
        ),
        stylus=Stylus(float_attr(stylus, "diameter_mm"), text_attr(stylus, "name", "")),
        runs=tuple(sorted(runs, key=lambda run: run.start_s)),
        taps=_taps(file),
        beam=None if beam is None else Beam(float_attr(beam, "slope"), float_attr(beam, "intercept_mm")),
        clocks=tuple(_clock(group) for group in _children(file, "clocks")),
        started_utc=text_attr(file, "started_utc", ""),
        started_s=_optional_float(file, "started_s"),
        clock=text_attr(file, "clock", ""),
        notes=_log(file.get("notes")),
        protocol_toml=_long_text(file, "protocol_toml"),
        seed=_seed(file),
        devices=_texts(file, "devices"),
        details=_texts(file, "details"),
        software=text_attr(file, "software", ""),
        calibration=_calibration(file.get("calibration")),
    )


def _texts(file: Any, name: str) -> dict[str, str]:
    return {key: text_attr(_group(file, name), key) for key in file[name].attrs} if name in file else {}


def run_of(group: Any, columns: Columns = read_columns) -> Run:
    """A run from its group; one cut off reads as "aborted"."""
    outcome = text_attr(group, "outcome", "aborted")
    target = group.get("target")
    return Run(
        id=group.name.rsplit("/", 1)[-1],
        protocol=text_attr(group, "protocol"),
        start_s=float_attr(group, "start_s"),
        duration_s=float_attr(group, "duration_s"),
        touch=_touch(_group(group, "touch"), columns),
        laser=_laser(_group(group, "laser"), columns),
        nominal_speed_mm_s=_optional_float(group, "nominal_speed_mm_s"),
        radius_mm=_optional_float(group, "radius_mm"),
        target={} if target is None else {key: read_attr(target, key) for key in target.attrs},
        display=_display(group.get("display"), columns),
        sync=tuple(_clock(child) for child in _children(group, "sync")),
        log=_log(group.get("log")),
        outcome="aborted" if outcome == "recording" else outcome,
        seed=_seed(group),
    )


READERS: dict[int, Callable[..., Session]] = {1: read_layout, 2: read_layout}


def _group(parent: Any, name: str) -> Any:
    group = parent.get(name)
    if not isinstance(group, h5py.Group):
        raise DataError(message("the group {group}/{name} is missing", group=parent.name.rstrip("/"), name=name))
    return group


def _children(parent: Any, name: str) -> list[Any]:
    if name not in parent:
        return []
    group = _group(parent, name)
    return [_group(group, key) for key in group]


def _optional_float(item: Any, key: str) -> float | None:
    return float_attr(item, key) if key in item.attrs else None


def _seed(item: Any) -> int | None:
    return int(read_attr(item, "seed")) if "seed" in item.attrs else None


def _long_text(group: Any, name: str) -> str:
    if name not in group:
        return ""
    value = group[name][()]
    if not isinstance(value, bytes):
        raise DataError(message("{group}{name} is not text", group=group.name, name=name))
    return value.decode("utf-8", "replace")


def _calibration(group: Any) -> TouchCalibration | None:
    if group is None:
        return None
    columns = read_columns(group, schema.CALIBRATION)
    matrix = np.array([float_attr(group, name) for name in schema.AFFINE]).reshape(2, 3)
    return TouchCalibration(
        columns["x_raw"],
        columns["y_raw"],
        columns["x_mm"],
        columns["y_mm"],
        matrix,
        text_attr(group, "device", ""),
        text_attr(group, "made_utc", ""),
    )


def _gaps(group: Any) -> FloatArray:
    if "gaps" not in group:
        return np.empty((0, 2))
    columns = read_columns(group["gaps"], schema.GAPS)
    return np.column_stack([columns["start_s"], columns["end_s"]])


def _touch(group: Any, read: Columns) -> TouchTrace:
    columns = read(group, schema.TOUCH)
    return TouchTrace(
        t_s=columns["time"],
        x_mm=columns["x_mm"],
        y_mm=columns["y_mm"],
        contact_id=columns["contact_id"],
        x_raw=columns["x_raw"],
        y_raw=columns["y_raw"],
        device_t_s=columns["device_s"],
        gaps_s=_gaps(group),
        dropped=int_attr(group, "dropped", 0),
        axes=_axes(group),
    )


def _axes(group: Any) -> tuple[AxisInfo, ...]:
    if "axes" not in group:
        return ()
    columns = read_columns(group["axes"], schema.AXES)
    numbers = zip(*(columns[key] for key in ("minimum", "maximum", "resolution", "fuzz")), strict=True)
    return tuple(
        AxisInfo(name.decode("utf-8", "replace"), *(int(value) for value in row))
        for name, row in zip(columns["name"], numbers, strict=True)
    )


def _laser(group: Any, read: Columns) -> LaserTrace:
    columns = read(group, schema.LASER)
    return LaserTrace(
        t_s=columns["time"],
        light=columns["light"],
        device_t_s=columns["device_s"],
        epoch=columns["epoch"],
        gaps_s=_gaps(group),
        missed=int_attr(group, "missed", 0),
    )


def _display(group: Any, read: Columns) -> DisplayTrace | None:
    if group is None:
        return None
    columns = read(group, schema.DISPLAY)
    return DisplayTrace(columns["time"], columns["x_mm"], columns["y_mm"], int_attr(group, "missed", 0))


def _clock(group: Any) -> ClockBounds:
    columns = read_columns(group, schema.CLOCK)
    return ClockBounds(
        text_attr(group, "stream"),
        columns["device_s"],
        columns["host_min_s"],
        columns["host_max_s"],
        columns["epoch"],
    )


def _taps(file: Any) -> Taps | None:
    if "taps" not in file:
        return None
    group = file["taps"]
    columns = read_columns(group, schema.TAPS)
    rejected = group.get("rejected")
    counts = {} if rejected is None else {key: int_attr(rejected, key) for key in rejected.attrs}
    return Taps(columns["physical_s"], columns["registered_s"], columns["down"], counts)


def _log(group: Any) -> tuple[LogEntry, ...]:
    if group is None:
        return ()
    columns = read_columns(group, schema.LOG)
    entries: list[LogEntry] = []
    for t_s, level, source, part, text in zip(
        *(columns[key] for key in ("time_s", "level", "source", "part", "text")), strict=True
    ):
        words = text.decode("utf-8", "replace")
        if part > 0 and entries:
            last = entries[-1]
            entries[-1] = LogEntry(last.t_s, last.level, last.source, last.text + words)
        else:
            entries.append(LogEntry(float(t_s), _utf8(level), _utf8(source), words))
    return tuple(entries)


def _utf8(value: bytes) -> str:
    return value.decode("utf-8", "replace")
