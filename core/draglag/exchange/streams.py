"""From the rows of a CSV file to a trace: keep what is sound, say what is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from draglag.errors import DataError
from draglag.exchange.tables import line_of_row, read_table
from draglag.recording import LaserTrace, Taps, TouchTrace, empty_laser, empty_touch

Floats = NDArray[np.float64]


def read_touch(path: Path | None) -> tuple[TouchTrace, list[str]]:
    """Touch events and what was mended: rows without a number left out, times put in order, repeated rows merged.

    Different reports with one stamp are kept: a host that delivers its frames in batches writes such, and that is
    something to be found, not mended. Estimates go by the last of them, as a program that reads them does.
    """
    if path is None:
        return empty_touch(), ["there is no touch file"]
    rows, said = _finite(path, read_table(path, ("t_s", "x_mm", "y_mm")))
    rows, more = _in_order(path, rows)
    said += more
    doubled = np.append((np.diff(rows, axis=0) == 0).all(axis=1), False)[: len(rows)]
    if doubled.any():
        said.append(f"{path.name}: {int(doubled.sum())} rows come twice and count once")
        rows = rows[~doubled]
    if not len(rows):
        return empty_touch(), [*said, f"{path.name}: holds no touch events"]
    t_s, x_mm, y_mm = (np.ascontiguousarray(column) for column in rows.T)
    return TouchTrace(t_s, x_mm, y_mm), said


def read_laser(path: Path | None) -> tuple[LaserTrace, list[str]]:
    """Edges and what was mended. A level that comes twice running means a missing edge and is counted as such.

    Raises DataError for a level other than 0 and 1.
    """
    if path is None:
        return empty_laser(), ["there is no laser file"]
    table = read_table(path, ("t_s", "light"))
    rows, said = _finite(path, table)
    odd = np.flatnonzero(~np.isin(table[:, 1], (0.0, 1.0)) & np.isfinite(table).all(axis=1))
    if len(odd):
        raise DataError(
            f"{path}, line {line_of_row(path, int(odd[0]))}: expected light 0 or 1, found {table[odd[0], 1]:g}",
            "Correct or remove that line",
        )
    rows, more = _in_order(path, rows)
    said += more
    same = np.append(False, (np.diff(rows[:, 0]) == 0) & (np.diff(rows[:, 1]) == 0))[: len(rows)]
    if same.any():
        said.append(f"{path.name}: {int(same.sum())} edges come twice and count once")
        rows = rows[~same]
    if not len(rows):
        return empty_laser(), [*said, f"{path.name}: holds no edges"]
    missed = int((np.diff(rows[:, 1]) == 0).sum())
    if missed:
        said.append(f"{path.name}: {missed} edges are missing (the same level twice running)")
    light = rows[:, 1].astype(np.int64)
    return LaserTrace(np.ascontiguousarray(rows[:, 0]), light, missed=missed), said


def read_taps(path: Path) -> tuple[Taps, list[str]]:
    """Taps as they were timed. Raises DataError."""
    if not path.is_file():
        raise DataError(f"{path}: there is no such file", "Set taps to null in session.json if there are none")
    table = read_table(path, ("physical_s", "registered_s", "down"))
    rows, said = _finite(path, table)
    odd = np.flatnonzero(~np.isin(table[:, 2], (0.0, 1.0)) & np.isfinite(table).all(axis=1))
    if len(odd):
        raise DataError(
            f"{path}, line {line_of_row(path, int(odd[0]))}: expected down 0 or 1, found {table[odd[0], 2]:g}",
            "Correct or remove that line",
        )
    physical_s, registered_s, down = (np.ascontiguousarray(column) for column in rows.T)
    return Taps(physical_s, registered_s, down.astype(np.int64)), said


def _finite(path: Path, rows: Floats) -> tuple[Floats, list[str]]:
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if not len(bad):
        return rows, []
    first = line_of_row(path, int(bad[0]))
    keep = np.isfinite(rows).all(axis=1)
    return rows[keep], [f"{path.name}: {len(bad)} rows hold no number and are left out, the first in line {first}"]


def _in_order(path: Path, rows: Floats) -> tuple[Floats, list[str]]:
    back = np.flatnonzero(np.diff(rows[:, 0]) < 0)
    if not len(back):
        return rows, []
    said = f"{path.name}: times go back {len(back)} times (first to {rows[back[0] + 1, 0]:g} s); put in order"
    return rows[np.argsort(rows[:, 0], kind="stable")], [said]
