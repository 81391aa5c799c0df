"""A session from other programs' touch and laser files."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from draglag.errors import DataError
from draglag.exchange.importers.columns import (
    LASER_DEFAULTS,
    ColumnMap,
    parse_map,
    read_laser_columns,
    read_touch_columns,
)
from draglag.exchange.importers.evemu import read_evemu
from draglag.exchange.importers.evtest import read_evtest
from draglag.exchange.importers.input_log import InputLog, mapping_of
from draglag.exchange.importers.libinput import read_libinput
from draglag.exchange.importers.walt import ROUNDED, read_walt_laser
from draglag.exchange.importers.xdf import read_xdf
from draglag.exchange.tables import column_names
from draglag.messages import Message, message
from draglag.reading import plain_lines
from draglag.reading.contacts import at_once
from draglag.reading.limits import SIZE_MM, SIZE_PX
from draglag.reading.off_screen import off_screen
from draglag.recording import LaserTrace, LogEntry, Run, Screen, Session, Stylus, TouchTrace, empty_laser
from draglag.store.schema import check_run_id, slug

LOGS: dict[str, Callable[[Path], InputLog]] = {"evtest": read_evtest, "evemu": read_evemu, "libinput": read_libinput}
FORMATS = (*LOGS, "xdf", "csv")
_HEAD_BYTES = 2**16
# How each format's text begins its lines; the first that is found decides.
_SIGNS = {
    "libinput": re.compile(r"^(# libinput record|ndevices:)", re.MULTILINE),
    "evtest": re.compile(r"^(Event: time|Input driver version)", re.MULTILINE),
    "evemu": re.compile(r"^(E: \d|# EVEMU|N: )", re.MULTILINE),
}
STYLUS_MM = 7.0
"""Stylus diameter of the paper, mm: the default, stated in the notes."""


@dataclass(frozen=True)
class HowToRead:
    """What a recording lacks.

    Attributes:
        format: one of ``FORMATS``; None to detect it.
        laser: its file; None for the one next to the recording.
        units_per_mm: device units per mm, where axes have no resolution.
        protocol: one of ``recording.PROTOCOLS``.
    """

    format: str | None = None
    laser: Path | None = None
    map: ColumnMap = field(default_factory=lambda: parse_map(()))
    screen: Screen | None = None
    units_per_mm: float | None = None
    stylus_mm: float | None = None
    protocol: str = "free"


def read_recordings(paths: tuple[Path, ...], how: HowToRead | None = None) -> Session:
    """A session, one run per recording. Raises DataError."""
    how = how or HowToRead()
    if how.laser is not None and len(paths) > 1:
        raise DataError(
            message("{laser}: one laser file belongs to one recording", laser=how.laser), "Import them one by one"
        )
    runs: list[Run] = []
    screens: list[Screen] = []
    for number, path in enumerate(paths, 1):
        touch, laser, screen, said = _read(path, how)
        run_id = slug(path.name.split(".")[0])[:60]
        if run_id in {run.id for run in runs}:
            run_id = f"{run_id}-{number}"
        runs.append(_run(check_run_id(run_id, str(path)), path, touch, laser, how.protocol, said))
        screens.append(screen)
    if len(set(screens)) > 1:
        raise DataError(
            message("{path}: is of another screen than {other}", path=paths[1], other=paths[0].name),
            "Import them one by one",
        )
    notes = [entry for run in runs for entry in run.log]
    notes += [LogEntry(runs[0].start_s, "warning", "import", text) for text in off_screen(screens[0], runs)]
    if how.stylus_mm is None:
        notes.append(
            LogEntry(
                runs[0].start_s,
                "warning",
                "import",
                message("the stylus is taken to be {width_mm:g} mm wide", width_mm=STYLUS_MM),
            )
        )
    return Session(
        name=paths[0].name if len(paths) == 1 else paths[0].resolve().parent.name,
        screen=screens[0],
        stylus=Stylus(STYLUS_MM if how.stylus_mm is None else how.stylus_mm),
        runs=tuple(sorted(runs, key=lambda run: run.start_s)),
        clock="that of the imported recordings, seconds",
        notes=tuple(notes),
        devices={"touch": f"recording {paths[0].name}"},
    )


def laser_file_of(path: Path) -> Path | None:
    """The laser's file next to a recording: ``<name>.laser.csv[.gz]``, or WALT's ``…_laser.log``."""
    stem = path.name.split(".")[0]
    names = [f"{stem}.laser.csv", f"{stem}.laser.csv.gz"]
    if stem.endswith("_evtest"):
        names.insert(0, f"{stem.removesuffix('_evtest')}_laser.log")
    return next((path.with_name(name) for name in names if path.with_name(name).is_file()), None)


def format_of(path: Path) -> str:
    """The format by name and first lines. Raises DataError."""
    if path.name.lower().endswith(".xdf"):
        return "xdf"
    head = plain_lines(path)[:_HEAD_BYTES].decode("utf-8", errors="replace")
    for kind, sign in _SIGNS.items():
        if sign.search(head):
            return kind
    if path.name.lower().endswith((".csv", ".csv.gz", ".tsv", ".txt")):
        return "csv"
    raise DataError(
        message("{path}: its format is not known", path=path),
        message("Name it with --format: {formats}", formats=", ".join(FORMATS)),
    )


def _read(path: Path, how: HowToRead) -> tuple[TouchTrace, LaserTrace, Screen, list[str]]:
    kind = how.format or format_of(path)
    said: list[str] = []
    laser: LaserTrace | None = None
    screen = how.screen
    if kind in LOGS:
        log = LOGS[kind](path)
        said += [message("its last line is cut off and left out")] if log.cut else []
        touch = _touch(path, log, how)
        screen = screen or _screen_of(log, how.units_per_mm, path, said)
    elif kind == "xdf":
        touch, laser = read_xdf(path, how.map, screen, how.units_per_mm, said)
    else:
        touch = read_touch_columns(path, how.map, screen, how.units_per_mm)
    if screen is None:
        raise DataError(
            message("{path}: does not describe the screen", path=path), "Give --screen, a preset or a TOML file"
        )
    if not len(touch.t_s):
        raise DataError(
            message("{path}: holds no touch events", path=path), "Record a touchscreen, from before it is touched"
        )
    laser_file = how.laser or (laser_file_of(path) if laser is None else None)
    if laser_file is not None:
        laser = _read_laser(laser_file, how.map, said)
    if laser is None:
        said.append(message("there is no laser file"))
    elif not len(laser.t_s):
        said.append(_without_edges(laser_file or path, how.map))
    if touch.dropped:
        said.append(f"{touch.dropped} touch events are lost or could not be read")
    said += at_once(touch)
    return *_on_one_clock(path, touch, laser or empty_laser(), how.map), screen, said


def _touch(path: Path, log: InputLog, how: HowToRead) -> TouchTrace:
    known = (how.screen.width_mm, how.screen.height_mm) if how.screen else log.size_mm
    width_mm, height_mm = known or (None, None)
    try:
        mapping = mapping_of(log, width_mm, height_mm, how.units_per_mm)
    except DataError as error:
        remedy = "Give --screen, or --units-per-mm" if log.position_axes() else "Give --units-per-mm"
        raise DataError(message("{path}: {problem}", path=path, problem=error.problem), remedy) from error
    try:
        return log.touch(mapping)
    except DataError as error:
        raise DataError(message("{path}: {problem}", path=path, problem=error.problem), error.remedy) from error


def _read_laser(path: Path, how: ColumnMap, said: list[str]) -> LaserTrace:
    table = path.name.endswith((".csv", ".csv.gz")) or "laser.light" in how.columns
    if table or LASER_DEFAULTS["laser.light"][0] in column_names(path):
        laser = read_laser_columns(path, how)
    else:
        laser = read_walt_laser(path)
        said.append(ROUNDED)
    if laser.missed:
        said.append(f"{path.name}: {laser.missed} edges are missing (the same level twice running)")
    return laser


def _without_edges(path: Path, how: ColumnMap) -> Message:
    _, unit = how.names(("laser.light",), LASER_DEFAULTS)["laser.light"]
    if unit[0] in "<>":
        return message("{path}: holds no edges, its signal never crosses {threshold}", path=path.name,
                       threshold=unit[1:])  # fmt: skip
    return message("{path}: holds no edges", path=path.name)


def _on_one_clock(path: Path, touch: TouchTrace, laser: LaserTrace, how: ColumnMap) -> tuple[TouchTrace, LaserTrace]:
    shift_s, laser_shift_s = how.shift_s.get("clock", 0.0), how.shift_s.get("laser.clock", 0.0)
    touch = replace(touch, t_s=touch.t_s + shift_s, gaps_s=touch.gaps_s + shift_s)
    laser = replace(laser, t_s=laser.t_s + laser_shift_s)
    if len(laser.t_s) and (laser.t_s[-1] < touch.t_s[0] or laser.t_s[0] > touch.t_s[-1]):
        raise DataError(
            message(
                "{path}: the touch's times ({touch_from:.3f} to {touch_to:.3f} s) and the laser's "
                "({laser_from:.3f} to {laser_to:.3f} s) share no moment",
                path=path,
                touch_from=touch.t_s[0],
                touch_to=touch.t_s[-1],
                laser_from=laser.t_s[0],
                laser_to=laser.t_s[-1],
            ),
            "Both must be on one clock; --map laser.clock=SECONDS moves the laser's",
        )
    return touch, laser


def _screen_of(log: InputLog, units_per_mm: float | None, path: Path, said: list[str]) -> Screen | None:
    axes = log.position_axes()
    if axes is None:
        return None
    spans = [axis.maximum - axis.minimum + 1 for axis in axes]
    if log.size_mm is not None:
        width_mm, height_mm = log.size_mm
    else:
        width_mm, height_mm = (span / (units_per_mm or axis.resolution) for span, axis in zip(spans, axes, strict=True))
    if not all(0 < mm <= SIZE_MM for mm in (width_mm, height_mm)) or not all(0 < span <= SIZE_PX for span in spans):
        size = f"{width_mm:g} × {height_mm:g} mm, {spans[0]} × {spans[1]} units"
        raise DataError(
            message("{path}: by its touchscreen, the screen is {size}", path=path, size=size), "Give --screen"
        )
    said.append("the screen's size is what its touchscreen says, its pixels are the touchscreen's units")
    return Screen(log.name or path.name, width_mm, height_mm, *spans)


def _run(run_id: str, path: Path, touch: TouchTrace, laser: LaserTrace, protocol: str, said: list[str]) -> Run:
    both = np.concatenate([touch.t_s, laser.t_s])
    start_s = float(both.min())
    log = tuple(
        LogEntry(start_s, "warning", "import", message("{path}: {text}", path=path.name, text=text)) for text in said
    )
    return Run(run_id, protocol, start_s, float(both.max()) - start_s, touch, laser, log=log)
