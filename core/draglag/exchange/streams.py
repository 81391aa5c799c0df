"""CSV rows → traces, unsound rows left out and reported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from draglag.errors import DataError
from draglag.exchange.tables import column_names, line_of_row, read_table
from draglag.messages import message
from draglag.reading.limits import EVENT_S, TIME_S
from draglag.recording import DisplayTrace, LaserTrace, Taps, TouchTrace, empty_laser, empty_touch

Floats = NDArray[np.float64]


TOUCH_MORE = ("contact_id", "x_raw", "y_raw", "device_t_s")
LASER_MORE = ("device_t_s", "epoch")
FEWEST_EVENTS = 8  # from which their usual interval is known


def read_touch(path: Path | None, more: Path | None = None, as_recorded: bool = False) -> tuple[TouchTrace, list[str]]:
    """Touch events, and corrections made: rows without numbers left out, times sorted, repeated rows merged.

    more: further columns of the same rows. as_recorded: draglag wrote the rows, so repeated ones stay.

    Different reports of one stamp stay: hosts that deliver in batches write such.
    """
    if path is None:
        return empty_touch(), [message("there is no touch file")]
    table, names = _with_more(path, read_table(path, ("t_s", "x_mm", "y_mm")), more, TOUCH_MORE)
    rows, notes = _finite(path, table, 3)
    rows, sorting = _in_order(path, rows)
    notes += sorting
    doubled = np.append((np.diff(rows, axis=0) == 0).all(axis=1), False)[: len(rows)]
    if doubled.any() and not as_recorded:
        notes.append(message("{path}: {n} rows come twice and count once", path=path.name, n=int(doubled.sum())))
        rows = rows[~doubled]
    if not len(rows):
        return empty_touch(), notes if as_recorded else [
            *notes,
            message("{path}: holds no touch events", path=path.name),
        ]
    t_s, x_mm, y_mm = (np.ascontiguousarray(column) for column in rows.T[:3])
    check_interval(t_s, str(path), "Give all times in seconds")
    return TouchTrace(t_s, x_mm, y_mm, **_further(more, names, rows[:, 3:])), notes


def check_interval(t_s: Floats, where: str, remedy: str) -> None:
    """Raises DataError where the events of a run, in order of time, come as seldom as no touchscreen sends them."""
    apart_s = np.diff(t_s)
    apart_s = apart_s[apart_s > 0]
    if len(t_s) >= FEWEST_EVENTS and len(apart_s) and (usual_s := float(np.median(apart_s))) > EVENT_S:
        problem = message(
            "{where}: the events of a run come one every {usual_s:.3g} s on the median, as from no touchscreen",
            where=where,
            usual_s=usual_s,
        )
        raise DataError(problem, remedy)


def read_laser(path: Path | None, more: Path | None = None, as_recorded: bool = False) -> tuple[LaserTrace, list[str]]:
    """Edges, and corrections made; unless ``as_recorded``, a repeated level is a missing edge. Raises DataError."""
    if path is None:
        return empty_laser(), [message("there is no laser file")]
    table = read_table(path, ("t_s", "light"), switches=("light",))
    odd = np.flatnonzero(~np.isin(table[:, 1], (0.0, 1.0)) & np.isfinite(table).all(axis=1))
    table, names = _with_more(path, table, more, LASER_MORE)
    rows, notes = _finite(path, table, 2)
    if len(odd):
        raise DataError(
            message(
                "{path}, line {line}: expected light 0 or 1, found {found:g}",
                path=path,
                line=line_of_row(path, int(odd[0])),
                found=table[odd[0], 1],
            ),
            "Correct or remove that line",
        )
    rows, sorting = _in_order(path, rows)
    notes += sorting
    same = np.append(False, (np.diff(rows[:, 0]) == 0) & (np.diff(rows[:, 1]) == 0))[: len(rows)]
    if same.any() and not as_recorded:
        notes.append(message("{path}: {n} edges come twice and count once", path=path.name, n=int(same.sum())))
        rows = rows[~same]
    if not len(rows):
        return empty_laser(), notes if as_recorded else [*notes, message("{path}: holds no edges", path=path.name)]
    missed = 0 if as_recorded else int((np.diff(rows[:, 1]) == 0).sum())
    if missed:
        notes.append(message("{path}: {n} edges are missing (the same level twice running)", path=path.name, n=missed))
    light = rows[:, 1].astype(np.int64)
    further = _further(more, names, rows[:, 2:])
    return LaserTrace(np.ascontiguousarray(rows[:, 0]), light, missed=missed, **further), notes


def read_taps(path: Path) -> tuple[Taps, list[str]]:
    """Taps, and corrections made. Raises DataError."""
    if not path.is_file():
        raise DataError(
            message("{path}: there is no such file", path=path), "Set taps to null in session.json if there are none"
        )
    table = read_table(path, ("physical_s", "registered_s", "down"), switches=("down",))
    rows, notes = _finite(path, table)
    odd = np.flatnonzero(~np.isin(table[:, 2], (0.0, 1.0)) & np.isfinite(table).all(axis=1))
    if len(odd):
        raise DataError(
            message(
                "{path}, line {line}: expected down 0 or 1, found {found:g}",
                path=path,
                line=line_of_row(path, int(odd[0])),
                found=table[odd[0], 2],
            ),
            "Correct or remove that line",
        )
    rows, more = _in_order(path, rows)
    physical_s, registered_s, down = (np.ascontiguousarray(column) for column in rows.T)
    return Taps(physical_s, registered_s, down.astype(np.int64)), notes + more


def read_display(path: Path, missed: int) -> tuple[DisplayTrace, list[str]]:
    """Where the target was drawn, and corrections made."""
    rows, notes = _finite(path, read_table(path, ("t_s", "x_mm", "y_mm")))
    rows, more = _in_order(path, rows)
    t_s, x_mm, y_mm = (np.ascontiguousarray(column) for column in rows.T)
    return DisplayTrace(t_s, x_mm, y_mm, missed), notes + more


def read_gaps(path: Path) -> Floats:
    """Gaps of a stream, (n, 2). Raises DataError where one ends before it starts."""
    gaps = np.ascontiguousarray(read_table(path, ("start_s", "end_s")))
    bad = np.flatnonzero(~((gaps[:, 0] <= gaps[:, 1]) & (np.abs(gaps) <= TIME_S).all(axis=1)))
    if len(bad):
        line = line_of_row(path, int(bad[0]))
        raise DataError(
            message("{path}, line {line}: expected start_s no later than end_s", path=path, line=line),
            "Correct or remove that line",
        )
    return gaps


def _with_more(
    path: Path, table: Floats, more: Path | None, allowed: tuple[str, ...]
) -> tuple[Floats, tuple[str, ...]]:
    if more is None:
        return table, ()
    names = tuple(name for name in allowed if name in column_names(more))
    extra = read_table(more, ("t_s", *names))
    if len(extra) != len(table) or not np.array_equal(extra[:, 0], table[:, 0], equal_nan=True):
        raise DataError(
            message(
                "{path}: its rows are not those of {other} ({n} against {of}, with the same t_s)",
                path=more,
                other=path.name,
                n=len(extra),
                of=len(table),
            ),
            "Export both files again, or remove this optional one",
        )
    return np.column_stack([table, extra[:, 1:]]), names


def _further(more: Path | None, names: tuple[str, ...], columns: Floats) -> dict[str, Any]:
    return {
        name: whole(more, name, column) if name in ("contact_id", "epoch") and more else np.ascontiguousarray(column)
        for name, column in zip(names, columns.T, strict=True)
    }


def whole(path: Path, name: str, values: Floats) -> NDArray[np.int64]:
    """A column as integers. Raises DataError: fractions, NaN, beyond 2⁵³."""
    if not ((np.abs(values) <= 2**53) & (np.mod(values, 1) == 0)).all():
        raise DataError(
            message("{path}: expected whole numbers for {name}", path=path, name=name),
            "Correct or remove this optional file",
        )
    return values.astype(np.int64)


def _finite(path: Path, rows: Floats, among: int = 3) -> tuple[Floats, list[str]]:
    numbers = rows[:, :among]
    far = np.flatnonzero(np.isfinite(rows[:, 0]) & (np.abs(rows[:, 0]) > TIME_S))
    if len(far):
        found = message(
            "{path}, line {line}: {found:g} cannot be a time in seconds",
            path=path,
            line=line_of_row(path, int(far[0])),
            found=rows[far[0], 0],
        )
        raise DataError(found, "Give all times in seconds")
    bad = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
    if not len(bad):
        return rows, []
    first = line_of_row(path, int(bad[0]))
    keep = np.isfinite(numbers).all(axis=1)
    return rows[keep], [
        message(
            "{path}: {n} rows hold no number and are left out, the first in line {first}",
            path=path.name,
            n=len(bad),
            first=first,
        )
    ]


def _in_order(path: Path, rows: Floats) -> tuple[Floats, list[str]]:
    back = np.flatnonzero(np.diff(rows[:, 0]) < 0)
    if not len(back):
        return rows, []
    notes = message(
        "{path}: times go back {n} times (first to {t_s:g} s); put in order",
        path=path.name,
        n=len(back),
        t_s=rows[back[0] + 1, 0],
    )
    return rows[np.argsort(rows[:, 0], kind="stable")], [notes]
