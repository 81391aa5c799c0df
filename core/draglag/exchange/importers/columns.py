"""Columns of another program's table, by ``--map KEY=COLUMN[:UNIT]`` (docs/importing.md); errors name file and line."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from draglag.errors import DataError
from draglag.exchange.streams import check_interval
from draglag.exchange.tables import event_columns, line_of_row, read_events
from draglag.messages import message
from draglag.reading.limits import CONTACT, TIME_S
from draglag.recording import FloatArray, IntArray, LaserTrace, Screen, TouchTrace
from draglag.touch_events.frames import Mapping2D

_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_LENGTH = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
UNITS = {
    "t": tuple(_TIME), "x": (*_LENGTH, "px", "raw"), "y": (*_LENGTH, "px", "raw"), "contact": ("1",),
    "device_t": tuple(_TIME), "laser.t": tuple(_TIME), "laser.light": ("1",),
}  # fmt: skip
CLOCKS = ("clock", "laser.clock")
STREAMS = ("stream", "laser.stream")
TOUCH_DEFAULTS = {"t": ("t_s", "s"), "x": ("x_mm", "mm"), "y": ("y_mm", "mm")}
LASER_DEFAULTS = {"laser.t": ("t_s", "s"), "laser.light": ("light", "1")}
CHANGES_ONLY = 0.8  # of the rows change the level: the table was written at changes, their stamps are the edges
HOLE = 3.5  # usual intervals without a sample


@dataclass(frozen=True)
class ColumnMap:
    """``columns``: key → (name of the column, unit); ``shift_s``: "clock" or "laser.clock" → seconds to add."""

    columns: dict[str, tuple[str, str]]
    shift_s: dict[str, float]
    streams: dict[str, str]

    def names(self, keys: Iterable[str], defaults: dict[str, tuple[str, str]]) -> dict[str, tuple[str, str]]:
        """Column and unit of the keys that are mapped or have a default."""
        known = {**defaults, **self.columns}
        return {key: known[key] for key in keys if key in known}


def parse_map(texts: Iterable[str]) -> ColumnMap:
    """The map of ``--map`` texts; default units are the first of ``UNITS``. Raises DataError."""
    columns: dict[str, tuple[str, str]] = {}
    shift_s: dict[str, float] = {}
    streams: dict[str, str] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if key in {*columns, *shift_s, *streams}:
            raise DataError(message("--map {text}: {key} is mapped twice", text=text, key=key), "Map each key once")
        if key in CLOCKS:
            shift_s[key] = _seconds(text, value)
            continue
        if key in STREAMS and value:
            streams[key] = value
            continue
        if key not in UNITS or not equals or not value:
            known = ", ".join([*UNITS, *CLOCKS, *STREAMS])
            raise DataError(
                message("--map {text}: is not KEY=COLUMN[:UNIT]", text=text), message("Keys are {known}", known=known)
            )
        column, _, unit = value.rpartition(":") if ":" in value else (value, "", UNITS[key][0])
        if unit not in UNITS[key] and not (key == "laser.light" and unit[:1] in ("<", ">") and _is_number(unit[1:])):
            raise DataError(
                message("--map {text}: “{unit}” is no unit of {key}", text=text, unit=unit, key=key),
                message("Use one of {units}", units=", ".join(UNITS[key])),
            )
        columns[key] = (column, unit)
    return ColumnMap(columns, shift_s, streams)


def read_touch_columns(path: Path, how: ColumnMap, screen: Screen | None, units_per_mm: float | None) -> TouchTrace:
    """Touch events of a table."""
    found = how.names(("t", "x", "y", "contact", "device_t"), TOUCH_DEFAULTS)
    contact = [name for key, (name, _) in found.items() if key == "contact"]
    rows = read_events(path, [name for name, _ in found.values()], names_in=contact)
    by_key = dict(zip(found, rows.T, strict=True))
    return touch_of(by_key, {key: unit for key, (_, unit) in found.items()}, str(path), screen, units_per_mm, path)


def read_positions(path: Path, how: ColumnMap, screen: Screen | None, units_per_mm: float | None) -> FloatArray:
    """Times and positions of a table, s and mm, (n, 3), all rows as they come; NaN for cells without a number."""
    found = how.names(("t", "x", "y"), TOUCH_DEFAULTS)
    rows = read_events(path, [name for name, _ in found.values()])
    factors = [_TIME[found["t"][1]]]
    factors += [_per_mm(axis, found[axis][1], str(path), screen, units_per_mm) for axis in ("x", "y")]
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(rows * factors + [how.shift_s.get("clock", 0.0), 0.0, 0.0])


def read_contacts(path: Path, column: str) -> IntArray:
    """Numbers of the contacts of a table, (n,): equal ones for equal texts, −1 for missing ones. Raises DataError."""
    there = event_columns(path)
    if column not in there:
        raise DataError(
            message("{path}: no column {column} in its first line", path=path, column=column),
            message("Its columns are {columns}", columns=",".join(there)),
        )
    return _contacts(read_events(path, [column], names_in=(column,))[:, 0], str(path), path)


def touch_of(
    by_key: dict[str, FloatArray], units: dict[str, str], where: str, screen: Screen | None,
    units_per_mm: float | None, path: Path | None = None,
) -> TouchTrace:  # fmt: skip
    """A trace from columns in their units."""
    t_s = _checked_times(by_key["t"] * _TIME[units["t"]], where, path)
    if path is not None:  # a table: stamps of XDF are seconds
        check_interval(t_s, where, "Give the unit of the time, as in --map t=COLUMN:ms")
    factors = {axis: _per_mm(axis, units[axis], where, screen, units_per_mm) for axis in ("x", "y")}
    mapping = Mapping2D(factors["x"], 0.0, 0.0, 0.0, factors["y"], 0.0)
    with np.errstate(over="ignore", invalid="ignore"):
        sound = np.isfinite(mapping(by_key["x"], by_key["y"])).all(axis=0)
    x, y = by_key["x"][sound], by_key["y"][sound]
    x_mm, y_mm = mapping(x, y)
    contact = None if "contact" not in by_key else _contacts(by_key["contact"], where, path)
    device = by_key.get("device_t")
    raw = "mm" not in (units["x"], units["y"])
    return TouchTrace(
        t_s[sound],
        x_mm,
        y_mm,
        np.zeros(len(x), np.int64) if contact is None else contact[sound],
        x if raw else np.empty(0),
        y if raw else np.empty(0),
        np.empty(0) if device is None else device[sound] * _TIME[units["device_t"]],
        dropped=int((~sound).sum()),
    )


def _contacts(numbers: FloatArray, where: str, path: Path | None) -> IntArray:
    numbers = np.where(np.isnan(numbers), -1.0, numbers)
    odd = np.flatnonzero(~((np.abs(numbers) <= CONTACT) & (np.trunc(numbers) == numbers)))
    if odd.size:
        raise DataError(
            message(
                "{place}: {found:g} is no number of a contact",
                place=_place(where, path, int(odd[0])),
                found=numbers[odd[0]],
            ),
            "Map the column that numbers or names the contacts, or none",
        )
    return numbers.astype(np.int64)


def read_laser_columns(path: Path, how: ColumnMap) -> LaserTrace:
    """Edges of a table."""
    found = how.names(("laser.t", "laser.light"), LASER_DEFAULTS)
    rows = read_events(path, [name for name, _ in found.values()], switches=(found["laser.light"][0],))
    return laser_of(rows[:, 0], rows[:, 1], found["laser.t"][1], found["laser.light"][1], str(path), path)


def laser_of(
    t: FloatArray, light: FloatArray, time_unit: str, light_unit: str, where: str, path: Path | None = None
) -> LaserTrace:
    """Edges from levels, or from a signal that crosses a threshold."""
    t_s = _checked_times(t * _TIME[time_unit], where, path)
    if light_unit[0] in "<>":
        return _crossings(t_s, light, float(light_unit[1:]), above=light_unit[0] == ">")
    odd = np.flatnonzero(~np.isin(light, (0.0, 1.0)))
    if len(odd):
        raise DataError(
            message(
                "{place}: expected light 0 or 1, found {found:g}",
                place=_place(where, path, int(odd[0])),
                found=light[odd[0]],
            ),
            "Correct that line, or give a threshold, as in --map laser.light=COLUMN:>0.5",
        )
    level = light.astype(np.int64)
    return LaserTrace(t_s, level, missed=int((np.diff(level) == 0).sum()))


def _crossings(t_s: FloatArray, light: FloatArray, threshold: float, above: bool) -> LaserTrace:
    """Edges where a signal crosses the threshold: between two samples, as a straight line through both does."""
    sampled = np.isfinite(light)
    t_s, light = t_s[sampled], light[sampled]
    level = (light > threshold if above else light < threshold).astype(np.int64)
    after = np.flatnonzero(np.diff(level)) + 1
    if len(after) > CHANGES_ONLY * (len(level) - 1):
        return LaserTrace(t_s[after], level[after])
    low, high = light[after - 1], light[after]
    with np.errstate(all="ignore"):  # spans of the largest and the smallest numbers
        part = np.clip(np.nan_to_num((threshold - low) / (high - low), nan=0.5), 0.0, 1.0)
    dt_s = np.diff(t_s)
    usual_s = np.median(dt_s[dt_s > 0]) if (dt_s > 0).any() else 0.0
    between_s = dt_s[after - 1]
    # A logger that leaves out what does not change: the signal stayed as it was until the sample that is due before.
    between_s = np.where(between_s > HOLE * usual_s, usual_s, between_s)
    return LaserTrace(t_s[after] - (1.0 - part) * between_s, level[after])


def _checked_times(t_s: FloatArray, where: str, path: Path | None) -> FloatArray:
    bad = ~(np.abs(t_s) <= TIME_S)  # also what is no number
    bad[1:] |= t_s[1:] < t_s[:-1]
    if bad.any():
        line = int(np.flatnonzero(bad)[0])
        raise DataError(
            message(
                "{place}: times must be numbers that never go back, in seconds below {limit:g}",
                place=_place(where, path, line),
                limit=TIME_S,
            ),
            "Correct that line, or give the unit of the time, as in --map t=COLUMN:ms",
        )
    return np.ascontiguousarray(t_s)


def _place(where: str, path: Path | None, row: int) -> str:
    return where if path is None else f"{where}, line {line_of_row(path, row, notes=True)}"


def _per_mm(axis: str, unit: str, where: str, screen: Screen | None, units_per_mm: float | None) -> float:
    if unit in _LENGTH:
        return _LENGTH[unit]
    if unit == "raw":
        if units_per_mm is None:
            raise DataError(message("{path}: {axis} is in device units", path=where, axis=axis), "Give --units-per-mm")
        return 1 / units_per_mm
    if screen is None:
        raise DataError(message("{path}: {axis} is in pixels", path=where, axis=axis), "Give --screen")
    return screen.mm_per_px[axis == "y"]


def _seconds(text: str, value: str) -> float:
    if not _is_number(value) or abs(float(value)) > TIME_S:
        problem = f"--map {text}: expected a number of seconds, at most {TIME_S:g}"
        raise DataError(problem, "For example --map laser.clock=-0.25")
    return float(value)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
